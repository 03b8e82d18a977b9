"""Measures how quick and how small the running graph is, from outside; see README.md."""
