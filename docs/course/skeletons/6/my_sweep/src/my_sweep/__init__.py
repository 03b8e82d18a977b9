"""A sweep of an area, step by step."""
