"""Velocities from distances: following an object, and stopping before obstacles."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

from typing_extensions import override

from crazyflie_references.velocity_reference import Velocity
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.types import DURATION, Number

_DISTANCE = Number("m", above=0.0)


class ObjectFollower(Parameters):
    """Follows the object in front: at full speed ahead or back, or not at all.

    It backs off from an object nearer than ``back_off``, follows one beyond ``follow``, up to
    ``lost``, and otherwise stands still. It turns to an object that is not in front, but at one
    side only, up to ``lost`` away.
    """

    scale_linear: float = parameter(
        Number("m/s", minimum=0.0), "speed ahead and back", 0.3, live=True
    )
    scale_angular: float = parameter(
        Number("rad/s", minimum=0.0),
        "yaw rate towards an object at one side and not in front; 0: no turning",
        0.0,
        live=True,
    )
    back_off: float = parameter(
        _DISTANCE,
        "distance below which the vehicle backs off",
        0.3,
        "distances/back_off",
        live=True,
    )
    follow: float = parameter(
        _DISTANCE, "distance above which the vehicle follows", 0.6, "distances/follow", live=True
    )
    lost: float = parameter(
        _DISTANCE, "distance above which the object is lost", 2.0, "distances/lost", live=True
    )

    @override
    def complaints(self) -> Iterator[str]:
        if not self.back_off <= self.follow <= self.lost:
            yield (
                f"distances/back_off, follow and lost are {self.back_off:g}, {self.follow:g} and "
                f"{self.lost:g}; expected each >= the one before (m)"
            )

    def velocity(
        self, front: float, left: float | None = None, right: float | None = None
    ) -> tuple[float, float]:
        """Return the velocity ahead (m/s) and the yaw rate (rad/s, counter-clockwise).

        Distances are in m: infinite without an object, None if the sensor is silent.
        """
        if front < self.back_off:
            return -self.scale_linear, 0.0
        if front <= self.follow:
            return 0.0, 0.0
        if front <= self.lost:
            return self.scale_linear, 0.0
        is_left = left is not None and left <= self.lost
        is_right = right is not None and right <= self.lost
        return 0.0, self.scale_angular * (is_left - is_right)


#: Direction -> component of a velocity, and its sign there.
AXES: dict[str, tuple[str, int]] = {
    "front": ("x", 1),
    "back": ("x", -1),
    "left": ("y", 1),
    "right": ("y", -1),
    "up": ("z", 1),
    "down": ("z", -1),
}


class ObstacleStop(Parameters):
    """Limits velocities so that the vehicle comes to rest at a distance from every obstacle."""

    distance: float = parameter(
        Number("m", above=0.0),
        "distance from an obstacle below which no motion towards it is permitted",
        0.5,
        live=True,
    )
    deceleration: float = parameter(
        Number("m/s^2", above=0.0),
        "deceleration with which the vehicle brakes before that",
        0.5,
        live=True,
    )
    reaction: float = parameter(DURATION, "reaction time before the vehicle brakes", 0.3, live=True)

    def speed(self, clearance: float) -> float:
        """Return the largest speed (m/s) towards an obstacle that is ``clearance`` (m) away.

        At this speed, reaction and braking together take v t + v^2 / (2 a).
        """
        if math.isinf(clearance) and clearance > 0.0:
            return math.inf
        gap = max(clearance - self.distance, 0.0)
        delay = self.deceleration * self.reaction
        return math.sqrt(delay**2 + 2.0 * self.deceleration * gap) - delay

    def limit(self, velocity: Velocity, clearances: Mapping[str, float | None]) -> Velocity:
        """Return a velocity (heading frame), limited so that the vehicle stops before obstacles.

        ``clearances`` are those of the guarded directions, m; None, for a silent sensor, permits no
        motion.
        """
        for direction, clearance in clearances.items():
            axis, sign = AXES[direction]
            most = 0.0 if clearance is None else self.speed(clearance)
            # Adding 0.0 turns -0.0 into 0.0, for readers.
            limited = sign * min(sign * getattr(velocity, axis), most) + 0.0
            velocity = replace(velocity, **{axis: limited})
        return velocity
