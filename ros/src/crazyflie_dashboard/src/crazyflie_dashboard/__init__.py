"""Mission control in a browser."""
