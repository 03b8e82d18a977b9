"""References for controllers, from velocities."""
