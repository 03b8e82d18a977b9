"""Demos: joystick and keyboard, goals, waypoints, high-level flights, trajectories."""
