"""Simulated vehicles that come and go while the simulation runs."""
