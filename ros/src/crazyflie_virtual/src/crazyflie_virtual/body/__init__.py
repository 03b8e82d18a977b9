"""Airframe, battery and sensors."""
