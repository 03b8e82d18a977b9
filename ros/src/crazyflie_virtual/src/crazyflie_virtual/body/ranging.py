"""Ranging sensors: each sees what is along an axis of the body."""

import math

from crazyflie_model.angles import Triple, rotate
from crazyflie_virtual.body.physics import Physics

NOTHING = 32767  #: What a sensor reports that sees nothing, mm.
_REACH = 4.0  #: m.

#: Log variable -> where its sensor looks, body frame.
_DIRECTIONS: dict[str, Triple] = {
    "front": (1.0, 0.0, 0.0),
    "back": (-1.0, 0.0, 0.0),
    "left": (0.0, 1.0, 0.0),
    "right": (0.0, -1.0, 0.0),
    "up": (0.0, 0.0, 1.0),
    "zrange": (0.0, 0.0, -1.0),
}


class RangingSensors:
    """Distances, mm, as whole numbers; 0 where there is no sensor.

    A multiranger has sensors to all sides and up, a flow deck has one down.
    """

    def __init__(self, physics: Physics, has_multiranger: bool, has_flow_deck: bool):
        self._physics = physics
        self.has_multiranger = has_multiranger
        self.has_flow_deck = has_flow_deck

    def distance(self, side: str) -> int:
        """Return what the sensor of a log variable (of the group ``range``) reports, mm."""
        if not (self.has_flow_deck if side == "zrange" else self.has_multiranger):
            return 0
        direction = rotate(self._physics.quaternion, _DIRECTIONS[side])
        distance = self._distance(direction)
        return round(1000.0 * distance) if distance < _REACH else NOTHING

    def _distance(self, direction: Triple) -> float:
        physics = self._physics
        if physics.world is not None:
            return float(physics.world.cast(physics.position, direction)[0])
        height, fall = physics.position[2], -direction[2]
        return height / fall if fall > 0.0 else math.inf
