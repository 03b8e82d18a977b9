"""The reference of a descent: straight down from where the vehicle is."""

import math

from crazyflie_takeoff.motion import Position

DESCENT_MARGIN = 3.0  #: How much longer than calculated a descent may take, s.

#: A vehicle that does not sink for this long in a descent to an unknown ground is on it, s. It is
#: longer than the filter takes to notice a controller that does not follow (`DESCENT_TIMEOUT`).
STOP_TIME = 2.0
PROGRESS = 0.02  #: Less than this below where it was lowest, m, a vehicle does not sink.
SEARCH_LIMIT = 20.0  #: Longest descent to an unknown ground, s.

#: How far below the ground a descent's reference goes, m, so that the vehicle meets the ground with
#: its speed also when it hangs above the reference.
PRESS_DEPTH = 0.3


class Descent:
    """A reference that sinks at a constant speed (m/s) to the ground (z, m).

    Times are s since the landing began; at ``begin`` it is at ``position`` (m). To an unknown
    ground (``None``) it sinks without end, until the vehicle does not follow any more.
    """

    def __init__(self, begin: float, position: Position, ground: float | None, speed: float):
        self._begin = begin
        self._x, self._y, self._z = position
        self._speed = speed
        self._seen: tuple[float, float] | None = None
        if ground is None:
            self._lowest, self._end = -math.inf, begin + SEARCH_LIMIT
        else:
            self._lowest = min(ground - PRESS_DEPTH, self._z)
            self._end = begin + max(self._z - ground, 0.0) / speed + DESCENT_MARGIN

    def follow(self, time: float, z: float) -> bool:
        """Take a measured height (m); return whether it has not sunk for `STOP_TIME`."""
        if self._seen is None or z < self._seen[0] - PROGRESS:
            self._seen = z, time
        return time - self._seen[1] > STOP_TIME

    def is_over(self, time: float) -> bool:
        """Return whether a vehicle that follows has been on the ground for `DESCENT_MARGIN`."""
        return time > self._end

    def reference(self, time: float) -> tuple[float, float, float, float, float, float]:
        """Return x, y, z in m and x_dot, y_dot, z_dot in m/s."""
        z = self._z - self._speed * (time - self._begin)
        if z <= self._lowest:
            return (self._x, self._y, self._lowest, 0.0, 0.0, 0.0)
        return (self._x, self._y, z, 0.0, 0.0, -self._speed)
