"""Lists of waypoints, and which of them is the goal."""

import math
from typing import NamedTuple

from crazyflie_model.angles import wrap_to_pi
from crazyflie_utils.parameters.types import DURATION, FINITE, Converted
from crazyflie_utils.text import shown


class Waypoint(NamedTuple):
    """Position (m) and heading (rad) in the world frame, and the time to stay there (s)."""

    x: float
    y: float
    z: float
    yaw: float
    seconds: float


def _waypoints(value):
    if not isinstance(value, list) or not value:
        raise ValueError
    return [_waypoint(number, entry) for number, entry in enumerate(value)]


def _waypoint(number, entry):
    if not isinstance(entry, (list, tuple)) or len(entry) != len(Waypoint._fields):
        raise ValueError(f"waypoint {number} is {shown(entry)}")
    *pose, duration = entry
    try:
        x, y, z, yaw = map(FINITE, pose)
        return Waypoint(x, y, z, yaw, DURATION(duration))
    except ValueError:
        raise ValueError(f"waypoint {number} is {shown(entry)}") from None


WAYPOINTS = Converted(
    _waypoints,
    "a list of [x, y, z, yaw, seconds] in m, rad, s, finite, seconds >= 0",
    "list of [x, y, z, yaw, seconds]",
    "m, rad, s",
    "finite, seconds >= 0",
)


class WaypointFollower:
    """The waypoint that is the goal.

    After the seconds of a waypoint that is reached, the next one is the goal. The last one stays.
    """

    def __init__(self, waypoints: list[Waypoint]):
        self._waypoints = waypoints
        self._reached: float | None = None
        self.index = 0
        self.is_finished = False

    @property
    def goal(self) -> Waypoint:
        """The present goal."""
        return self._waypoints[self.index]

    def update(
        self,
        time: float,
        position: tuple[float, float, float],
        yaw: float,
        tolerances: tuple[float, float],
    ) -> None:
        """Advance to the next waypoint if it is due, at a time (s), position (m) and yaw (rad).

        A waypoint is reached within the tolerances of both (m and rad).
        """
        errors = math.dist(position, self.goal[:3]), abs(wrap_to_pi(yaw - self.goal.yaw))
        is_there = all(error <= most for error, most in zip(errors, tolerances, strict=True))
        if self._reached is None and is_there:
            self._reached = time
        if self._reached is None or time - self._reached < self.goal.seconds:
            return
        if self.index + 1 < len(self._waypoints):
            self.index += 1
            self._reached = None
        else:
            self.is_finished = True
