"""Another velocity for the sweep mission."""
