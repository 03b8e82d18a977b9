"""Ranging sensors: each sees what is along an axis of the body."""

import math

from crazyflie_model.angles import Triple, rotate
from crazyflie_virtual.body.physics import Physics

NOTHING = 32767
"""What a sensor reports that sees nothing, mm."""

_REACH = 4.0
"""m."""

_FRONT, _LEFT, _UP = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_BACK, _RIGHT, _DOWN = (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)


class RangingSensors:
    """Distances, mm, as whole numbers; 0 where there is no sensor.

    Parameters
    ----------
    physics : Physics
    has_multiranger : bool
        Whether there are sensors to all sides and up.
    has_flow_deck : bool
        Whether there is one down.
    """

    def __init__(self, physics: Physics, has_multiranger: bool, has_flow_deck: bool):
        self._physics = physics
        self.has_multiranger = has_multiranger
        self.has_flow_deck = has_flow_deck

    @property
    def front(self) -> int:
        """Along the body's x."""
        return self._side(_FRONT)

    @property
    def back(self) -> int:
        """Against the body's x."""
        return self._side(_BACK)

    @property
    def left(self) -> int:
        """Along the body's y."""
        return self._side(_LEFT)

    @property
    def right(self) -> int:
        """Against the body's y."""
        return self._side(_RIGHT)

    @property
    def up(self) -> int:
        """Along the body's z."""
        return self._side(_UP)

    @property
    def zrange(self) -> int:
        """Against the body's z."""
        return self._measure(_DOWN) if self.has_flow_deck else 0

    def _side(self, direction: Triple) -> int:
        return self._measure(direction) if self.has_multiranger else 0

    def _measure(self, axis: Triple) -> int:
        direction = rotate(self._physics.quaternion, axis)
        distance = self._distance(direction)
        return round(1000.0 * distance) if distance < _REACH else NOTHING

    def _distance(self, direction: Triple) -> float:
        physics = self._physics
        if physics.world is not None:
            return float(physics.world.cast(physics.position, direction)[0])
        height, fall = physics.position[2], -direction[2]
        return height / fall if fall > 0.0 else math.inf
