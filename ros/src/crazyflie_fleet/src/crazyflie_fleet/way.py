"""The way from one point of rest to another."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crazyflie_utils.refusal import RefusalError

MAX_SPEED = 2.0
"""Fastest that a way may be, m/s: controllers with the default gains follow it."""

MAX_ACCELERATION = 2.0
"""Largest acceleration of a way, m/s^2: controllers tilt by 15 degrees at most, which is
2.6 m/s^2."""

_PEAK = 15.0 / 8.0
"""Peak speed of a minimum-jerk way, in distances per duration."""

_PEAK_ACCELERATION = 10.0 / math.sqrt(3.0)
"""Its peak acceleration, in distances per square of the duration."""


def shortest(distance: float) -> float:
    """Return the shortest duration of a way of a length (m), s."""
    by_acceleration = math.sqrt(_PEAK_ACCELERATION * distance / MAX_ACCELERATION)
    return max(_PEAK * distance / MAX_SPEED, by_acceleration)


@dataclass(frozen=True)
class Way:
    """A straight line that begins and ends at rest, with the least jerk.

    Position along it is 10 s^3 - 15 s^4 + 6 s^5 with s = t / duration (Flash and Hogan, The
    coordination of arm movements, 1985).

    Attributes
    ----------
    start, goal : (3,) array
        m.
    duration : float
        s, > 0.
    """

    start: NDArray[np.float64]
    goal: NDArray[np.float64]
    duration: float

    def __post_init__(self) -> None:
        """Raise `RefusalError` if it asks for too much speed or acceleration."""
        distance = float(np.linalg.norm(self.goal - self.start))
        needed = shortest(distance)
        if not 0.0 < self.duration or needed > self.duration:
            raise RefusalError(
                f"{distance:.2f} m in {self.duration:g} s; expected a duration of at least "
                f"{needed:.2f} s (at most {MAX_SPEED:g} m/s and {MAX_ACCELERATION:g} m/s^2)"
            )


def along(
    ways: Sequence[Way], times: Sequence[float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return positions (m) and velocities (m/s) on n ways, shape (n, 3) each.

    Parameters
    ----------
    ways : sequence of Way
    times : sequence of float
        Since the start of each, s.
    """
    durations = np.array([way.duration for way in ways])
    s = np.clip(np.array(times) / durations, 0.0, 1.0)[:, None]
    start = np.array([way.start for way in ways])
    path = np.array([way.goal for way in ways]) - start
    position = start + path * (s**3 * (10.0 - 15.0 * s + 6.0 * s * s))
    return position, path * (30.0 * s * s * (1.0 - s) ** 2 / durations[:, None])
