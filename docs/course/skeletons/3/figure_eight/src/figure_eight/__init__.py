"""Figures of eight, flown by velocity."""
