"""Support for tests: vehicles with scripted answers."""
