"""Flights: what to fly, how to record it and how to judge it."""
