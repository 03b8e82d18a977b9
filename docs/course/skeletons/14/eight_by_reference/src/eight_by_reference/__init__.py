"""Figures of eight, by references."""
