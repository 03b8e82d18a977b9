"""Fleets of vehicles that one file describes: configuration, services and safety distances."""
