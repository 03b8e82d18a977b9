"""Filters of images, and a ball finder."""
