"""The reference of a descent: straight down from where the vehicle is."""

from crazyflie_takeoff.motion import Position

DESCENT_MARGIN = 3.0  #: How much longer than calculated a descent may take, s.

#: How far below the ground a descent's reference goes, m, so that the vehicle meets the ground with
#: its speed also when it hangs above the reference.
PRESS_DEPTH = 0.3


class Descent:
    """A reference that sinks at a constant speed (m/s) to the ground (z, m).

    Times are s since the landing began; at ``begin`` it is at ``position`` (m).
    """

    def __init__(self, begin: float, position: Position, ground: float, speed: float):
        self._begin = begin
        self._x, self._y, self._z = position
        self._speed = speed
        self._lowest = min(ground - PRESS_DEPTH, self._z)
        self._end = begin + max(self._z - ground, 0.0) / speed + DESCENT_MARGIN

    def is_over(self, time: float) -> bool:
        """Return whether a vehicle that follows has been on the ground for `DESCENT_MARGIN`."""
        return time > self._end

    def reference(self, time: float) -> tuple[float, float, float, float, float, float]:
        """Return x, y, z in m and x_dot, y_dot, z_dot in m/s."""
        z = self._z - self._speed * (time - self._begin)
        if z <= self._lowest:
            return (self._x, self._y, self._lowest, 0.0, 0.0, 0.0)
        return (self._x, self._y, z, 0.0, 0.0, -self._speed)
