"""Range sensors, simulated or on a deck; following an object, and stopping before one."""
