"""Vision: a simulated camera and a webcam, image filters, trackers, and following."""
