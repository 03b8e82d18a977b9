"""Simulated Crazyflies."""
