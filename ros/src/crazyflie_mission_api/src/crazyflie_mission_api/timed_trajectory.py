"""Commanded positions of the vehicles of a group, by time."""

import math
from collections.abc import Callable, Collection, Mapping

import numpy as np

from crazyflie_mission_api.clearance import Clearance
from crazyflie_mission_api.limits import Array, MissionError
from crazyflie_mission_api.trajectories import straight
from crazyflie_model.angles import Triple
from crazyflie_model.polynomials import Goal
from crazyflie_model.trajectory import Pieces, Trajectory

_STEP = 0.05  #: Between two times at which distances are checked, s.

START_SKEW = 0.15
"""Largest difference between the starts of vehicles behind the driver, s.

Each is called by itself, unless all of a driver are started. bench/start_skew.py measured at most
0.04 s for ten vehicles and 0.11 s for twenty, by UDP on a busy machine with two cores. A
Crazyradio, which serves its vehicles one after the other, has not been measured.
"""


class TimedTrajectory:
    """A trajectory from ``begin`` (s) on, then rest at its end.

    ``start_skew`` is how much later the vehicle may begin, s.
    """

    def __init__(self, pieces: Pieces, begin: float, start_skew: float = 0.0):
        self._trajectory = Trajectory(pieces)
        self.begin = begin
        self.start_skew = start_skew

    @classmethod
    def hover(cls, position: Triple, yaw: float = 0.0) -> "TimedTrajectory":
        """Return the trajectory of a vehicle that stays."""
        return cls(straight(position, position, yaw, yaw), -math.inf)

    @property
    def end(self) -> float:
        """Planned end, s."""
        return self.begin + self._trajectory.duration

    def goal(self, time: float) -> Goal[float]:
        """Return the goal at a time (s)."""
        return self._trajectory.evaluate(time - self.begin)

    @property
    def destination(self) -> Goal[float]:
        """The goal at the end, at rest."""
        return self._trajectory.evaluate(math.inf)

    def later(self, delay: float) -> "TimedTrajectory":
        """Return the trajectory of a vehicle that begins later, s."""
        return TimedTrajectory(self._trajectory.pieces, self.begin + delay, self.start_skew)

    def positions(self, times: Array) -> Array:
        """Return the positions at n times (s), shape (n, 3), m."""
        if self.end <= times[0]:
            return np.tile(self.destination.position, (len(times), 1))
        return np.stack(self._trajectory.evaluate(times - self.begin).position, axis=-1)


def check_with_skew(
    trajectories: Mapping[str, TimedTrajectory],
    now: float,
    check: Callable[[Mapping[str, TimedTrajectory]], None],
) -> None:
    """Check trajectories, also with each vehicle that may begin late later than the others.

    ``check(trajectories)`` raises `MissionError`; ``now`` is in s.
    """
    check(trajectories)
    moving = {name: each for name, each in trajectories.items() if each.end > now}
    skew = max((each.start_skew for each in moving.values()), default=0.0)
    if skew == 0.0 or len(trajectories) < 2:
        return
    for name, trajectory in moving.items():
        try:
            check({**trajectories, name: trajectory.later(skew)})
        except MissionError as error:
            raise MissionError(
                f"{error}; that is if {name} begins {skew:g} s after the others"
            ) from None


def check_apart(
    trajectories: Mapping[str, TimedTrajectory],
    now: float,
    clearance: Clearance,
    resting: Collection[str] = (),
) -> None:
    """Refuse trajectories on which two vehicles come too near, unless both are ``resting``.

    Raises
    ------
    MissionError
    """
    if len(trajectories) < 2:
        return
    end = max(now, *(each.end for each in trajectories.values()))
    times = np.linspace(now, end, math.ceil((end - now) / _STEP) + 1, dtype=np.float64)
    places = np.stack([each.positions(times) for each in trajectories.values()])
    clearance.check([*trajectories], times - now, places, resting)
