"""Programs for the command line that speak to a vehicle."""
