"""Seeing: a simulated camera and a real one, image filters, trackers, and following what they see."""
