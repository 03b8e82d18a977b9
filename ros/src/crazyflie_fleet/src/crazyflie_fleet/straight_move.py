"""Straight moves to a point of rest, from rest or in flight."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from crazyflie_model.trajectory import (
    MINIMUM_JERK_ACCELERATION,
    MINIMUM_JERK_SPEED,
    minimum_jerk,
)
from crazyflie_utils.refusal import RefusalError

MAX_SPEED = 2.0  #: Peak speed of a move (m/s): controllers with the default gains follow it.
#: Peak acceleration of a move (m/s^2): controllers tilt by 15 degrees at most, which is 2.6 m/s^2.
MAX_ACCELERATION = 2.0
_PEAK_BRAKING = 3.94  #: Peak acceleration of the braking, in speeds per duration.


def braking_time(speed: float) -> float:
    """Return the braking time of a speed (m/s), s: at half of `MAX_ACCELERATION`."""
    return _PEAK_BRAKING * speed / (MAX_ACCELERATION / 2.0)


def shortest_duration(distance: float, speed: float = 0.0) -> float:
    """Return the shortest duration of a move over a distance (m) that begins at a speed (m/s), s.

    Where the speed is not 0, braking has half of the acceleration, and half of the peak speed if
    it needs it.
    """
    acceleration = MAX_ACCELERATION if speed == 0.0 else MAX_ACCELERATION / 2.0
    by_acceleration = math.sqrt(MINIMUM_JERK_ACCELERATION * distance / acceleration)
    by_speed = MINIMUM_JERK_SPEED * distance / (MAX_SPEED - min(speed, MAX_SPEED / 2.0))
    return max(by_speed, by_acceleration, braking_time(speed))


@dataclass(frozen=True)
class StraightMove:
    """A straight line with the least jerk that ends at rest.

    If it begins with a velocity, s - 6 s^3 + 8 s^4 - 3 s^5 of velocity times braking time is added
    to `minimum_jerk`, with s = t / braking time: the polynomial of least degree that begins with
    the velocity and ends where it began, both without acceleration. The braking time, and so the
    distance it takes, does not depend on the duration.

    Raises
    ------
    RefusalError
        The move needs too much speed or acceleration.
    """

    #: start, goal: Positions (m).
    start: NDArray[np.float64]
    goal: NDArray[np.float64]
    duration: float  #: Duration, > 0 (s).
    #: Velocity at the start (m/s).
    velocity: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        needed = shortest_duration(self.distance, self.speed)
        if not 0.0 < self.duration or needed > self.duration:
            raise RefusalError(
                f"{self.distance:.2f} m in {self.duration:g} s; expected a duration of at least "
                f"{needed:.2f} s (at most {MAX_SPEED:g} m/s and {MAX_ACCELERATION:g} m/s^2)"
            )

    @property
    def distance(self) -> float:
        """Distance from start to goal, m."""
        return float(np.linalg.norm(self.goal - self.start))

    @property
    def speed(self) -> float:
        """Speed at the start, m/s."""
        return float(np.linalg.norm(self.velocity))


def evaluate(
    moves: Sequence[StraightMove], times: Sequence[float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return positions (m) and velocities (m/s) on n moves, shape (n, 3) each.

    Parameters
    ----------
    moves : sequence of StraightMove
    times : sequence of float
        Time since the start of each move, s.
    """
    durations = np.array([move.duration for move in moves])
    value, slope = minimum_jerk(np.clip(np.array(times) / durations, 0.0, 1.0)[:, None])
    start = np.array([move.start for move in moves])
    path = np.array([move.goal for move in moves]) - start
    position = start + path * value
    velocity = path * (slope / durations[:, None])
    # A positive divisor, also for moves from rest.
    braking = np.array([max(braking_time(move.speed), 1e-9) for move in moves])
    s = np.clip(np.array(times) / braking, 0.0, 1.0)[:, None]
    start_velocity = np.array([move.velocity for move in moves])
    position += start_velocity * braking[:, None] * (s - s**3 * (6.0 - 8.0 * s + 3.0 * s * s))
    velocity += start_velocity * (1.0 - s * s * (18.0 - 32.0 * s + 15.0 * s * s))
    return position, velocity
