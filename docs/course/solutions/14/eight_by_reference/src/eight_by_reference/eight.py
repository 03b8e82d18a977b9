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
        angle, side = self._angle(time)
        x, y, z = self.start
        return (
            x + self.radius * math.sin(angle),
            y + side * self.radius * (1.0 - math.cos(angle)),
            z,
        )

    def velocity(self, time: float) -> tuple[float, float, float]:
        """Return its velocity, m/s."""
        angle, side = self._angle(time)
        return self.speed * math.cos(angle), side * self.speed * math.sin(angle), 0.0

    def _angle(self, time):
        """Return the angle on the present circle, rad, and its side: -1 right, 1 left."""
        turns, angle = divmod(time * self.speed / self.radius, 2.0 * math.pi)
        return angle, -1.0 if turns % 2 == 0 else 1.0
