"""A mission that sweeps an area in lanes, at velocities that a service gives."""
