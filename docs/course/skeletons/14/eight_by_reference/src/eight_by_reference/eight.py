"""The algorithm: where a figure of eight is at a time; a position has no need of a heading."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Eight:
    """A circle to the right, a circle to the left, and again, from a start along x.

    Attributes
    ----------
    start : tuple of float
        x, y, z, m.
    radius : float
        Of both circles, m.
    speed : float
        Along them, m/s.
    """

    start: tuple[float, float, float]
    radius: float = 0.5
    speed: float = 0.3

    def position(self, time: float) -> tuple[float, float, float]:
        """Return where it is ``time`` seconds after the beginning, m."""
        raise NotImplementedError("step 2")

    def velocity(self, time: float) -> tuple[float, float, float]:
        """Return its velocity, m/s."""
        raise NotImplementedError("step 3")
