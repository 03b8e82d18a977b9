"""Straight lines in images."""
