"""Takeoff and landing."""
