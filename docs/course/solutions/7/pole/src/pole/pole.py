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
        beside = max(math.hypot(point[0] - self.x, point[1] - self.y) - self.radius, 0.0)
        above = max(point[2] - self.height, 0.0)
        return math.hypot(beside, above)
