"""The length of a flown path."""

import math


class Odometer:
    """Adds up the distances between consecutive positions.

    Attributes
    ----------
    max_step : float
        Two positions further apart than this (m) are a jump of the motion
        capture, which has not been flown.
    distance : float
        m.
    """

    def __init__(self, max_step: float):
        self.max_step = max_step
        self._last: tuple[float, float, float] | None = None
        self.distance = 0.0

    def add(self, position: tuple[float, float, float]) -> None:
        """Take the next position: x, y, z in m."""
        step = 0.0 if self._last is None else math.dist(self._last, position)
        self._last = position
        if step <= self.max_step:
            self.distance += step

    def reset(self) -> None:
        """Begin again at 0, from the last position."""
        self.distance = 0.0
