"""The algorithm: which way to turn, and when."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class FigureEight:
    """A circle to the right, a circle to the left, and again.

    Attributes
    ----------
    radius : float
        Of both circles, m.
    speed : float
        Along them, m/s.
    """

    radius: float
    speed: float

    def circles(self, time: float) -> int:
        """Return how many circles are complete ``time`` seconds after the beginning."""
        raise NotImplementedError("step 1")

    def yaw_rate(self, time: float) -> float:
        """Return the yaw rate v / r (rad/s), negative to the right."""
        raise NotImplementedError("step 2")
