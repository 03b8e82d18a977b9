"""A book of flights."""
