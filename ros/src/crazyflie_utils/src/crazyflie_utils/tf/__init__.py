"""Poses and transforms."""
