"""Velocities that lead to no obstacle."""

import math
from collections.abc import Mapping
from dataclasses import replace

from crazyflie_references.velocity_reference import Velocity
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.types import DURATION, Number

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

        Parameters
        ----------
        velocity : Velocity
        clearances : mapping
            Of the directions that are guarded, m; None where the sensor is silent: nothing
            leads there.
        """
        for direction, clearance in clearances.items():
            axis, sign = AXES[direction]
            most = 0.0 if clearance is None else self.speed(clearance)
            # + 0.0: not -0.0, for those who read it.
            limited = sign * min(sign * getattr(velocity, axis), most) + 0.0
            velocity = replace(velocity, **{axis: limited})
        return velocity
