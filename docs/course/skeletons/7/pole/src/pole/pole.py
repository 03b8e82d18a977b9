"""The algorithm: how near a vehicle is to a pole."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Pole:
    """A vertical cylinder on the ground.

    Attributes
    ----------
    x, y : float
        Its middle, m.
    radius, height : float
        m.
    """

    x: float
    y: float
    radius: float
    height: float

    def distance(self, point: tuple[float, float, float]) -> float:
        """Return how far a point (m) is from its surface, m; 0 inside."""
        raise NotImplementedError("step 1")
