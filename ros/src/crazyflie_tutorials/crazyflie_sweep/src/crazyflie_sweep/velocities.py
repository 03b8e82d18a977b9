"""Velocities by service: of an oscillator or at random, and the validity of an answer."""

import math
import random

from crazyflie_utils.refusal import RefusalError

OSCILLATOR_BEGIN = 2.0
OSCILLATOR_END = 9.0  #: Interval in which the oscillator has a velocity, ends included.

OSCILLATOR_LENGTH = OSCILLATOR_END - OSCILLATOR_BEGIN


def oscillator_velocity(x: float) -> float:
    """Return the velocity of a harmonic oscillator, 0.1 to 2.1 units of ``x`` per second.

    It is slow at both ends and fast in the middle: vel = 0.1 + 2 sin(pi x / 7 - 2 pi / 7), from an
    exercise of the course Robot Programming with ROS (C. T. Recchiuto, Genova). The summand 0.1
    makes it leave its ends. `RefusalError`: ``x`` is outside 2 to 9, or not a number.
    """
    if not OSCILLATOR_BEGIN <= x <= OSCILLATOR_END:
        raise RefusalError(f"x is {x:g}; expected {OSCILLATOR_BEGIN:g} to {OSCILLATOR_END:g}")
    return 0.1 + 2.0 * math.sin(math.pi * (x - OSCILLATOR_BEGIN) / OSCILLATOR_LENGTH)


def random_velocities(least: float, most: float, source: random.Random) -> tuple[float, float]:
    """Return two velocities, each uniformly distributed in an interval.

    `RefusalError`: the interval is empty or not finite.
    """
    if not (math.isfinite(least) and math.isfinite(most) and least <= most):
        raise RefusalError(f"min is {least:g}, max is {most:g}; expected finite min <= max")
    return source.uniform(least, most), source.uniform(least, most)


class VelocitySource:
    """The last velocity from a service, which is valid for ``limit`` (s).

    It must be > 0 and <= ``most``. ``start`` is the time of the first call, s.
    """

    def __init__(self, limit: float, most: float, start: float):
        self._limit = limit
        self._most = most
        self._velocity: float | None = None
        self._time = start
        self._failure = ""
        #: Reason why there is no velocity; empty while the first answer may still come in time.
        self.reason = ""

    def answer(self, velocity: float, time: float) -> None:
        """Process an answer that has come at ``time`` (s)."""
        if 0.0 < velocity <= self._most:
            self._velocity, self._time, self._failure = velocity, time, ""
        else:
            self._velocity = None
            self._failure = f"it answers {velocity:g}, which is not > 0 and <= {self._most:g}"

    def fail(self, reason: str) -> None:
        """Process a failed call; the last answer is used until it is too old."""
        self._failure = reason

    def velocity(self, time: float) -> float | None:
        """Return the velocity to use at ``time`` (s), or None; `reason` says why."""
        # After a reset of the clock the age is measured from there.
        self._time = min(self._time, time)
        is_late = time - self._time > self._limit
        if is_late:
            self._velocity = None
        self.reason = ""
        if self._velocity is None:
            self.reason = self._failure
            if is_late and not self._failure:
                self.reason = f"it has not answered for {self._limit:g} s"
        return self._velocity
