"""Where the vehicles of a team are told to be, now and later."""

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.polynomial import polynomial

from crazyflie_mission_api.clearance import Clearance
from crazyflie_mission_api.limits import Array, MissionError
from crazyflie_mission_api.trajectories import Pieces, straight
from crazyflie_model.angles import Triple
from crazyflie_model.polynomials import Goal
from crazyflie_model.trajectory import Trajectory

_STEP = 0.05
"""Of time, s, at which distances are looked at."""


START_SKEW = 0.15
"""How far apart vehicles behind the driver may begin what they are told together, s.

Each is called by itself. bench/start_skew.py measured at most 0.04 s for ten vehicles and 0.11 s
for twenty, by UDP on a busy machine with two cores. A Crazyradio, which serves its vehicles one
after the other, has not been measured.
"""


class Course:
    """A vehicle's way, from ``begin`` (s) on, then rest at its end.

    Parameters
    ----------
    pieces : sequence of PolynomialPiece
    begin : float
        s.
    start_skew : float
        How much later the vehicle may begin, s.
    """

    def __init__(self, pieces: Pieces, begin: float, start_skew: float = 0.0):
        self._trajectory = Trajectory(tuple(pieces))
        self.begin = begin
        self.start_skew = start_skew

    @classmethod
    def rest(cls, position: Triple, yaw: float = 0.0) -> "Course":
        """Return the course of a vehicle that stays."""
        return cls(straight(position, position, yaw, yaw), -math.inf)

    @property
    def end(self) -> float:
        """When the vehicle should be there, s."""
        return self.begin + self._trajectory.duration

    def goal(self, time: float) -> Goal[float]:
        """Return where the vehicle should be at ``time`` (s)."""
        return self._trajectory.evaluate(time - self.begin)

    @property
    def destination(self) -> Goal[float]:
        """Where it ends, at rest."""
        return self._trajectory.evaluate(math.inf)

    def later(self, delay: float) -> "Course":
        """Return the course of a vehicle that begins later, s."""
        return Course(self._trajectory.pieces, self.begin + delay, self.start_skew)

    def positions(self, times: Array) -> Array:
        """Return where the vehicle should be, shape (n, 3), m."""
        if self.end <= times[0]:
            return np.tile(self.destination.position, (len(times), 1))
        places = np.empty((len(times), 3))
        local = np.clip(times - self.begin, 0.0, self._trajectory.duration)
        for piece in self._trajectory.pieces:
            inside = local >= 0.0
            for axis, coefficients in enumerate(piece.axes[:3]):
                places[inside, axis] = polynomial.polyval(local[inside], coefficients)
            local = local - piece.duration
        return places


def check_starts(
    courses: Mapping[str, Course], now: float, check: Callable[[Mapping[str, Course]], None]
) -> None:
    """Check courses; and where one may begin late, as if each vehicle were later than the others.

    Parameters
    ----------
    courses : mapping of str to Course
    now : float
        s.
    check : callable
        ``check(courses)`` raises `MissionError`.

    Raises
    ------
    MissionError
    """
    check(courses)
    moving = {name: course for name, course in courses.items() if course.end > now}
    skew = max((course.start_skew for course in moving.values()), default=0.0)
    if skew == 0.0 or len(courses) < 2:
        return
    for name, course in moving.items():
        try:
            check({**courses, name: course.later(skew)})
        except MissionError as error:
            raise MissionError(
                f"{error}; that is if {name} begins {skew:g} s after the others"
            ) from None


def check_apart(courses: Mapping[str, Course], now: float, clearance: Clearance) -> None:
    """Refuse courses on which two vehicles come too near.

    Raises
    ------
    MissionError
    """
    if len(courses) < 2:
        return
    end = max(now, *(course.end for course in courses.values()))
    times = np.linspace(now, end, math.ceil((end - now) / _STEP) + 1, dtype=np.float64)
    names = [*courses]
    places = np.stack([course.positions(times) for course in courses.values()])
    clearance.check(names, times - now, places)
