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
    """Follows what is in front: at full speed ahead or back, or not at all.

    Nearer than ``back_off`` it backs off; beyond ``follow``, up to ``lost``, it follows; else it
    stands still. What is not in front, but up to ``lost`` away at one side only, it turns to.
    """

    scale_linear: float = parameter(
        Number("m/s", minimum=0.0), "speed ahead and back", 0.3, live=True
    )
    scale_angular: float = parameter(
        Number("rad/s", minimum=0.0),
        "yaw rate to what is at one side and not in front; 0: no turning",
        0.0,
        live=True,
    )
    back_off: float = parameter(
        _DISTANCE, "backs off from what is nearer", 0.3, "distances/back_off", live=True
    )
    follow: float = parameter(
        _DISTANCE, "follows what is farther away", 0.6, "distances/follow", live=True
    )
    lost: float = parameter(
        _DISTANCE, "but not what is beyond this", 2.0, "distances/lost", live=True
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

        Distances are in m: infinite where there is nothing, None where a sensor is silent.
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
    """Limits velocities to what comes to rest at a distance from every obstacle."""

    distance: float = parameter(
        Number("m", above=0.0), "nearer to an obstacle, nothing leads towards it", 0.5, live=True
    )
    deceleration: float = parameter(
        Number("m/s^2", above=0.0), "with which the vehicle brakes before that", 0.5, live=True
    )
    reaction: float = parameter(DURATION, "that it flies on until it brakes", 0.3, live=True)

    def speed(self, clearance: float) -> float:
        """Return the largest speed (m/s) towards an obstacle that is ``clearance`` (m) away.

        The one with which reaction and braking together take v t + v^2 / (2 a).
        """
        if math.isinf(clearance) and clearance > 0.0:
            return math.inf
        gap = max(clearance - self.distance, 0.0)
        delay = self.deceleration * self.reaction
        return math.sqrt(delay**2 + 2.0 * self.deceleration * gap) - delay

    def limit(self, velocity: Velocity, clearances: Mapping[str, float | None]) -> Velocity:
        """Return a velocity (heading frame) as far as it leads to no obstacle.

        ``clearances`` are those of the guarded directions, m; None, where the sensor is silent,
        permits no motion.
        """
        for direction, clearance in clearances.items():
            axis, sign = AXES[direction]
            most = 0.0 if clearance is None else self.speed(clearance)
            # + 0.0: not -0.0, for those who read it.
            limited = sign * min(sign * getattr(velocity, axis), most) + 0.0
            velocity = replace(velocity, **{axis: limited})
        return velocity
