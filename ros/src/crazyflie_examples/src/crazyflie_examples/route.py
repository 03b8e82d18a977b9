"""Points that a vehicle visits, one after the other, over and over again."""

from collections.abc import Sequence
from typing import Any

from typing_extensions import override

from crazyflie_utils.messages import shown
from crazyflie_utils.parameters.types import METRES, ParameterType

Point = tuple[float, float, float]  #: x, y, z in m.

#: Around the default hover point and back to it, m.
DEFAULT_POINTS: tuple[Point, ...] = (
    (0.5, 0.5, 1.0),
    (-0.5, 0.5, 1.0),
    (-0.5, -0.5, 1.5),
    (0.5, -0.5, 1.0),
    (0.0, 0.0, 1.0),
)


class Points(ParameterType):
    """A list of points."""

    label = "list of [x, y, z]"
    unit = "m"
    range = "at least one"

    @override
    def __call__(self, value: Any) -> tuple[Point, ...]:
        if not isinstance(value, list) or not value:
            raise ValueError
        return tuple(_point(number, item) for number, item in enumerate(value, start=1))

    @override
    def __str__(self) -> str:
        return "a list of points [x, y, z], finite numbers in m"


def _point(number, item):
    try:
        x, y, z = item
        return METRES(x), METRES(y), METRES(z)
    except (TypeError, ValueError):
        raise ValueError(f"point {number} is {shown(item)}") from None


class Route:
    """A cycle through points.

    Parameters
    ----------
    points : sequence of Point
        At least one.
    """

    def __init__(self, points: Sequence[Point]):
        self._points = tuple(points)
        self._next = 0

    def next_point(self) -> Point:
        """Return the next point, the first again after the last."""
        point = self._points[self._next]
        self._next = (self._next + 1) % len(self._points)
        return point
