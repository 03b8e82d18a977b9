"""Controls of several controllers, merged; and the form in which they are sent."""
