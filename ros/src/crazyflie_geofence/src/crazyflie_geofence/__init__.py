"""A controller that keeps a vehicle in a box."""
