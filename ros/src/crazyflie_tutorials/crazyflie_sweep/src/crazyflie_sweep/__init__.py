"""A mission that sweeps an area in lanes, at velocities from a service."""
