"""Where the vehicles of a team are told to be, now and later."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.polynomial import polynomial

from crazyflie_mission_api.formations import nearest
from crazyflie_mission_api.limits import Array, MissionError
from crazyflie_mission_api.trajectories import Pieces, straight
from crazyflie_model.angles import Triple
from crazyflie_model.polynomials import Goal
from crazyflie_model.trajectory import Trajectory

_STEP = 0.05
"""Of time, s, at which distances are looked at."""


class Course:
    """A vehicle's way, from ``begin`` (s) on, then rest at its end.

    Parameters
    ----------
    pieces : sequence of PolynomialPiece
    begin : float
        s.
    """

    def __init__(self, pieces: Pieces, begin: float):
        self._trajectory = Trajectory(tuple(pieces))
        self.begin = begin

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


def check_apart(courses: Mapping[str, Course], now: float, separation: float) -> None:
    """Refuse courses on which two vehicles come nearer than ``separation`` (m).

    Raises
    ------
    MissionError
    """
    if len(courses) < 2:
        return
    end = max(now, *(course.end for course in courses.values()))
    times = np.append(np.arange(now, end, _STEP), end)
    names = [*courses]
    places = np.stack([course.positions(times) for course in courses.values()])
    for k, time in enumerate(times):
        distance, one, two = nearest(names, places[:, k])
        if distance < separation:
            raise MissionError(
                f"{one} and {two} would be {distance:.3g} m apart, {time - now:.1f} s from now; "
                f"expected at least {separation:g} m"
            )
