"""Range sensors, simulated or on a deck; what follows an object, and what stops before one."""
