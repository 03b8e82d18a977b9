"""Nodes of the examples: moving from point to point, converting references."""
