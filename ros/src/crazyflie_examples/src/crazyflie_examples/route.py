"""Points that a vehicle visits, one after the other, over and over again."""

from collections.abc import Sequence

from crazyflie_utils.parameter_types import METRES

DEFAULT_POINTS = (
    (0.5, 0.5, 1.0),
    (-0.5, 0.5, 1.0),
    (-0.5, -0.5, 1.5),
    (0.5, -0.5, 1.0),
    (0.0, 0.0, 1.0),
)
"""Around the default hover point and back to it, m."""


class Points:
    """Kind of a parameter that lists points."""

    def __call__(self, value) -> tuple:
        """Return a tuple of (x, y, z), m."""
        if not isinstance(value, list) or not value:
            raise ValueError
        return tuple(_point(number, item) for number, item in enumerate(value, start=1))

    def __str__(self) -> str:
        """Return what is expected."""
        return "a list of points [x, y, z], finite numbers in m"


def _point(number, item):
    try:
        x, y, z = item
        return METRES(x), METRES(y), METRES(z)
    except (TypeError, ValueError):
        raise ValueError(f"point {number} is {item!r}") from None


class Tour:
    """A cycle through points.

    Parameters
    ----------
    points : sequence of (x, y, z)
        At least one, m.
    """

    def __init__(self, points: Sequence[tuple]):
        self.points = tuple(points)
        self._next = 0

    def move_on(self) -> tuple:
        """Return the next point (x, y, z) in m, the first again after the last."""
        point = self.points[self._next]
        self._next = (self._next + 1) % len(self.points)
        return point
