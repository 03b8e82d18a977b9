"""Filters that find the rate at which a sampled signal changes."""

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override


class RateFilter(ABC):
    """Signal and rate of n independent axes, from samples of the signal."""

    @abstractmethod
    def start(self, value: NDArray[np.float64]) -> None:
        """Forget everything and take the first sample, shape (n,)."""

    @abstractmethod
    def step(
        self, dt: float, value: NDArray[np.float64], acceleration: NDArray[np.float64] | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Take the next sample.

        Parameters
        ----------
        dt : float
            Time since the last sample, s, positive.
        value : ndarray, shape (n,)
        acceleration : ndarray, shape (n,), optional
            Commanded since the last sample, if it is known. Not every filter uses it.

        Returns
        -------
        value, rate : ndarray, shape (n,)
            The signal at the time of the sample and its rate, in units of the
            signal and units per second.
        """


class FiniteDifference(RateFilter):
    """The signal as it is sampled, and the difference quotient of its last two samples.

    The quotient is exact for linear signals; otherwise it is the rate half a
    period ago, up to second order. Independent noise of standard deviation s on
    the samples becomes sqrt(2) s / dt on the rate.
    """

    @override
    def start(self, value: NDArray[np.float64]) -> None:
        self._value = value

    @override
    def step(
        self, dt: float, value: NDArray[np.float64], acceleration: NDArray[np.float64] | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        rate = (value - self._value) / dt
        self._value = value
        return value, rate
