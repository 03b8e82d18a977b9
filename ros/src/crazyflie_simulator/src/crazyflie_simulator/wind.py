"""Moving air, with gusts."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.random import default_rng
from numpy.typing import ArrayLike

from crazyflie_model.angles import Triple

_WAVES = 64  #: Number of waves of a gust along each axis.


class Wind:
    """Velocity of the air, uniform in space, as a function of time.

    Along each axis the gust is a sum of cosines of equal amplitude and random phase, whose
    frequencies are spread over the spectrum of a first-order Gauss-Markov process (M. Shinozuka and
    G. Deodatis, Simulation of stochastic processes by spectral representation, 1991): zero mean,
    standard deviation ``gust`` (m/s), autocorrelation ``exp(-|t| / gust_time)`` (s). ``mean`` is in
    m/s, fixed frame, shape (3,). The same ``seed`` gives the same gust.
    """

    def __init__(
        self,
        mean: ArrayLike = (0.0, 0.0, 0.0),
        gust: float = 0.0,
        gust_time: float = 1.0,
        seed: int | Sequence[int] = 0,
    ):
        random = default_rng(seed)
        # One frequency out of each of equally likely intervals.
        self._quantiles = (np.arange(_WAVES) + random.uniform(size=(3, _WAVES))) / _WAVES
        self._phases = random.uniform(0.0, 2.0 * math.pi, size=(3, _WAVES))
        self.change(mean, gust, gust_time)

    def change(self, mean: ArrayLike, gust: float, gust_time: float) -> None:
        """Change the wind at once; the waves keep their random numbers."""
        x, y, z = np.asarray(mean, dtype=float).tolist()
        self._mean = (x, y, z)
        self._amplitude = gust * math.sqrt(2.0 / _WAVES)
        self._frequencies = np.tan(math.pi / 2.0 * self._quantiles) / gust_time

    def velocity(self, t: float) -> Triple:
        """Return the velocity of the air (3 components) at time ``t`` (s), m/s."""
        if self._amplitude == 0.0:
            return self._mean
        gust = self._amplitude * np.cos(self._frequencies * t + self._phases).sum(axis=1)
        x, y, z = (mean + part for mean, part in zip(self._mean, gust.tolist(), strict=True))
        return x, y, z
