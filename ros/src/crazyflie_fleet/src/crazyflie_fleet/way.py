"""The way to a point of rest, from rest or in a move."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

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


_PEAK_BRAKING = 3.94
"""Peak acceleration of the braking, in speeds per duration."""


def braking_time(speed: float) -> float:
    """Return how long a way brakes that begins at a speed (m/s), s: at half `MAX_ACCELERATION`."""
    return _PEAK_BRAKING * speed / (MAX_ACCELERATION / 2.0)


def shortest(distance: float, speed: float = 0.0) -> float:
    """Return the shortest duration of a way of a length (m) that begins at a speed (m/s), s.

    Where it begins in a move, braking has half of the acceleration, and half of the speed if it
    needs it.
    """
    acceleration = MAX_ACCELERATION if speed == 0.0 else MAX_ACCELERATION / 2.0
    by_acceleration = math.sqrt(_PEAK_ACCELERATION * distance / acceleration)
    by_speed = _PEAK * distance / (MAX_SPEED - min(speed, MAX_SPEED / 2.0))
    return max(by_speed, by_acceleration, braking_time(speed))


@dataclass(frozen=True)
class Way:
    """A straight line that begins and ends at rest, with the least jerk; and braking.

    Position along it is 10 s^3 - 15 s^4 + 6 s^5 with s = t / duration (Flash and Hogan, The
    coordination of arm movements, 1985). Where it begins in a move, s - 6 s^3 + 8 s^4 - 3 s^5 of
    velocity times braking time is added, with s = t / braking time: the polynomial of least degree
    that begins with the velocity and ends where it began, both without acceleration. The braking
    time does not grow with the duration, and so nor does the distance it takes.

    Attributes
    ----------
    start, goal : (3,) array
        m.
    duration : float
        s, > 0.
    velocity : (3,) array
        At the start, m/s.
    """

    start: NDArray[np.float64]
    goal: NDArray[np.float64]
    duration: float
    velocity: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        """Raise `RefusalError` if it asks for too much speed or acceleration."""
        distance = float(np.linalg.norm(self.goal - self.start))
        needed = shortest(distance, self.speed)
        if not 0.0 < self.duration or needed > self.duration:
            raise RefusalError(
                f"{distance:.2f} m in {self.duration:g} s; expected a duration of at least "
                f"{needed:.2f} s (at most {MAX_SPEED:g} m/s and {MAX_ACCELERATION:g} m/s^2)"
            )

    @property
    def speed(self) -> float:
        """At the start, m/s."""
        return float(np.linalg.norm(self.velocity))


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
    velocity = path * (30.0 * s * s * (1.0 - s) ** 2 / durations[:, None])
    # At rest nothing is left of it, however short it is.
    braking = np.array([max(braking_time(way.speed), 1e-9) for way in ways])
    s = np.clip(np.array(times) / braking, 0.0, 1.0)[:, None]
    start_velocity = np.array([way.velocity for way in ways])
    position += start_velocity * braking[:, None] * (s - s**3 * (6.0 - 8.0 * s + 3.0 * s * s))
    velocity += start_velocity * (1.0 - s * s * (18.0 - 32.0 * s + 15.0 * s * s))
    return position, velocity
