"""Profiles in time of a takeoff and a landing: the plan, the ramp, and the reference that sinks.

Heights and positions are in m, fixed frame, z up; thrusts in m/s^2.
"""

import math
from dataclasses import dataclass

from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.motion import PROGRESS, Position

RAMP_DURATION = 1.0  #: Default duration of the ramp of a landing; zero thrust follows (s).
RAMP_DEPTH = 5.0  #: Decrease of the thrust in that ramp, which begins at g (m/s^2).
#: Last thrust of a ramp that begins with a given takeoff thrust (m/s^2).
RAMP_END = 9.0
DESCENT_MARGIN = 3.0  #: Time that a descent may take beyond its calculated duration (s).
#: Depth of the last reference of a descent below the ground (m): the vehicle meets the ground with
#: its speed also when it hangs above the reference.
PRESS_DEPTH = 0.3
#: In a descent to an unknown ground, a vehicle that has not sunk for this time is down (s). The
#: filter notices a controller that does not follow sooner (`DESCENT_TIMEOUT`).
STOP_TIME = 2.0
SEARCH_LIMIT = 20.0  #: Longest descent to an unknown ground (s).


class Descent:
    """A reference that sinks at a constant speed (m/s) to the ground (z, m).

    Times are s since the landing began; at ``begin`` it is at ``position`` (m). With an unknown
    ground (None) it sinks until the vehicle does not follow any more.
    """

    def __init__(self, begin: float, position: Position, ground: float | None, speed: float):
        self._begin = begin
        self._x, self._y, self._z = position
        self._speed = speed
        self._is_search = ground is None
        # The lowest height that was measured (m), and when (s).
        self._reached = (self._z, begin)
        if ground is None:
            self._lowest, self._end = -math.inf, begin + SEARCH_LIMIT
        else:
            self._lowest = min(ground - PRESS_DEPTH, self._z)
            self._end = begin + max(self._z - ground, 0.0) / speed + DESCENT_MARGIN

    def measure(self, time: float, z: float) -> None:
        """Record a measured height of the vehicle (m)."""
        if z < self._reached[0] - PROGRESS:
            self._reached = z, time

    def is_over(self, time: float) -> bool:
        """Return whether a vehicle that follows is on the ground."""
        has_stopped = self._is_search and time - self._reached[1] > STOP_TIME
        return has_stopped or time > self._end

    def reference(self, time: float) -> tuple[float, float, float, float, float, float]:
        """Return x, y, z in m and x_dot, y_dot, z_dot in m/s."""
        z = self._z - self._speed * (time - self._begin)
        if z <= self._lowest:
            return (self._x, self._y, self._lowest, 0.0, 0.0, 0.0)
        return (self._x, self._y, z, 0.0, 0.0, -self._speed)


@dataclass(frozen=True)
class TakeoffPlan:
    """Durations and speed of takeoffs and landings."""

    hover: Position
    open_loop: float  # Duration of `LIFT_OFF_THRUST` (s).
    settle: float  # Time for the controller to reach the hover point (s).
    descent_speed: float  # m/s; 0 for a landing without a descent, by the ramp alone.
    ramp: float = RAMP_DURATION  # Duration of the thrust ramp of a landing (s).
    thrust: float | None = None  # In place of `LIFT_OFF_THRUST`, and of g in the ramp (m/s^2).

    def ramp_thrust(self, time: float, hover: float = GRAVITY) -> float:
        """Return the thrust of a landing ``time`` s after the begin of its ramp, m/s^2.

        ``hover`` is the thrust of hover as it was measured: more of it would lift the vehicle.
        """
        begin = min(hover, GRAVITY) if self.thrust is None else self.thrust
        end = begin - RAMP_DEPTH if self.thrust is None else min(begin, RAMP_END)
        return begin - (begin - end) * min(time / self.ramp, 1.0)
