"""Where a vehicle is and how it moves, as measured."""

import math
from typing import NamedTuple

MAX_STATE_AGE = 0.2
"""A state that is older does not count, s."""

DRIFT = 0.1
"""How fast the age that is taken for usual may grow, s/s."""


class Motion(NamedTuple):
    """A measured state.

    Attributes
    ----------
    position, velocity : tuple of float, length 3
        m and m/s, fixed frame, z up.
    yaw : float
        rad.
    """

    position: tuple[float, float, float]
    velocity: tuple[float, float, float]
    yaw: float = 0.0


class Measurement:
    """The last measured state, and its age.

    Attributes
    ----------
    age : float
        s; infinite before the first one.
    """

    def __init__(self) -> None:
        self.age = math.inf
        self._motion: Motion | None = None

    def update(self, motion: Motion, age: float) -> None:
        """Take a state that was measured ``age`` s ago."""
        self._motion, self.age = motion, age

    def advance(self, step: float) -> None:
        """Let time pass, s."""
        self.age += step

    def within(self, age: float) -> Motion | None:
        """Return the state if it is younger than ``age`` (s)."""
        return self._motion if self.age < age else None

    @property
    def fresh(self) -> Motion | None:
        """The state, unless it is older than `MAX_STATE_AGE`."""
        return self.within(MAX_STATE_AGE)


class Delay:
    """How much later than usual messages come, by the stamps of their data.

    The usual age is the smallest one, which is believed to grow at `DRIFT`: so a clock of another
    machine that is a little off, or a source that needs its time, makes nothing late.
    """

    def __init__(self) -> None:
        self._usual = math.inf
        self._stamp: float | None = None
        self._time = -math.inf

    def excess(self, stamp: float, now: float) -> float:
        """Return how much older than usual the data of a message are, s.

        Parameters
        ----------
        stamp : float
            Of the data, s; zero, or the same again, says nothing about an age.
        now : float
            By the same clock, s.
        """
        if stamp == 0.0 or stamp == self._stamp:
            return 0.0
        self._stamp = stamp
        age = now - stamp
        self._usual = min(age, self._usual + DRIFT * max(now - self._time, 0.0))
        self._time = now
        return age - self._usual
