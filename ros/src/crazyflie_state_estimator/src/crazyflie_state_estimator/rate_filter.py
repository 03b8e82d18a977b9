"""Filters that find the rate at which a sampled signal changes."""

from abc import ABC, abstractmethod
from collections.abc import Sequence

from typing_extensions import override

#: One number for each axis. Of so few, plain floats are several times quicker than arrays.
Components = Sequence[float]
#: No source of poses is so quick, s: stamps that are nearer to each other are bad ones.
LEAST_STEP = 0.0005


class RateFilter(ABC):
    """Signal and rate of n independent axes, from samples of the signal."""

    @abstractmethod
    def start(self, value: Components) -> None:
        """Forget everything and take the first sample, n components."""

    @abstractmethod
    def step(
        self, dt: float, value: Components, acceleration: Components | None = None
    ) -> tuple[Components, Components]:
        """Take the next sample; return the signal at its time, and its rate per second.

        It comes ``dt`` s after the last one (positive) and has n components, as has the
        acceleration that was commanded since then, if it is known. Not every filter uses it.
        """


class FiniteDifference(RateFilter):
    """The signal as it is sampled, and the difference quotient of its last two samples.

    The quotient is exact for linear signals; otherwise it is the rate half a period ago, up to
    second order. Independent noise of standard deviation s on the samples becomes sqrt(2) s / dt on
    the rate; so samples that come sooner than ``least_step`` (s) after one another leave the rate
    as it was, until so much time has passed.
    """

    def __init__(self, least_step: float = LEAST_STEP):
        self._least_step = least_step

    @override
    def start(self, value: Components) -> None:
        self._value = value
        self._elapsed = 0.0
        self._rate: Components = [0.0] * len(value)

    @override
    def step(
        self, dt: float, value: Components, acceleration: Components | None = None
    ) -> tuple[Components, Components]:
        self._elapsed += dt
        if self._elapsed >= self._least_step:
            elapsed = self._elapsed
            self._rate = [(a - b) / elapsed for a, b in zip(value, self._value, strict=True)]
            self._value, self._elapsed = value, 0.0
        return value, self._rate
