"""Kalman filter for signals whose acceleration changes slowly."""

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from crazyflie_state_estimator.rate_filter import RateFilter

POSITION_NOISE, ANGLE_NOISE = 0.001, 0.005
"""Default noise of poses, m and rad: a motion capture system that is not at its best."""

ACCELERATION_WALK = 3.0
"""Default for a vehicle whose control is not known, m/s^2/sqrt(s). Its tilt is limited to
15 degrees, or 2.6 m/s^2, and may go from side to side in a second."""

ACCELERATION_WALK_WITH_CONTROL = 1.0
"""Default where the control is known: wind, and how the vehicle differs from its model."""

ANGULAR_ACCELERATION_WALK = 30.0
"""Default for roll, pitch and yaw, rad/s^2/sqrt(s): with `ANGLE_NOISE` at 100 Hz their
rates are followed up to about 40 rad/s."""

MEMORY = 1.0
"""After a longer pause between two samples, in s, the filter starts afresh: the
acceleration known by then is out of date."""

_FIRST_RATE_VARIANCE = 10.0**2
_FIRST_ACCELERATION_VARIANCE = 10.0**2


class ConstantAccelerationFilter(RateFilter):
    """Kalman filter on the model of constant acceleration, one for each axis.

    Each axis has the state (signal, rate, acceleration). The acceleration is a
    random walk, the samples carry independent noise. Model and covariance of
    the random walk are those of Y. Bar-Shalom, X. R. Li, T. Kirubarajan,
    Estimation with Applications to Tracking and Navigation, 2001, section 6.2.3
    (continuous Wiener process acceleration). The noise is the same on all axes,
    so one covariance serves them all.

    An acceleration that is known (from the control) enters by its changes only:
    the estimate takes each of them over, and the random walk makes up for what
    differs between model and vehicle. An offset, such as a weak battery or the
    ground under a vehicle that has too little thrust to leave it, is thereby
    found from the samples, and knowledge that comes or goes causes no jump.

    In between samples of period T the filter follows signals up to about
    ``(walk**2 / (noise**2 T)) ** (1/6)`` rad/s and averages out what is faster.

    Parameters
    ----------
    noise : float
        Standard deviation of a sample, in units of the signal.
    acceleration_walk : float
        How much the unknown part of the acceleration changes in a second: the
        standard deviation, in units / s^2 / sqrt(s).
    """

    def __init__(self, noise: float, acceleration_walk: float):
        self.tune(noise, acceleration_walk)
        self._state: NDArray[np.float64] = np.zeros((3, 0))
        self._covariance: NDArray[np.float64] = np.zeros((3, 3))
        self._acceleration: NDArray[np.float64] | None = None

    def tune(self, noise: float, acceleration_walk: float) -> None:
        """Change the parameters; the state and its covariance stay."""
        self._noise_variance = noise**2
        self._walk_density = acceleration_walk**2

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of (signal, rate, acceleration) of any one axis, shape (3, 3)."""
        return self._covariance

    @override
    def start(self, value: NDArray[np.float64]) -> None:
        """Take the first sample; next to nothing is assumed about rate and acceleration."""
        self._begin(value, np.zeros_like(value))

    @override
    def step(
        self, dt: float, value: NDArray[np.float64], acceleration: NDArray[np.float64] | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if dt > MEMORY:
            self._begin(value, (value - self._state[0]) / dt)
        else:
            self._take_over(acceleration)
            self._predict(dt)
            self._correct(value)
        return self._state[0], self._state[1]

    def _begin(self, value, rate):
        self._state = np.array([value, rate, np.zeros_like(value)])
        self._covariance = np.diag(
            [self._noise_variance, _FIRST_RATE_VARIANCE, _FIRST_ACCELERATION_VARIANCE]
        )
        self._acceleration = None

    def _take_over(self, acceleration):
        if acceleration is not None and self._acceleration is not None:
            self._state[2] += acceleration - self._acceleration
        self._acceleration = acceleration

    def _predict(self, dt):
        dt2, dt3 = dt**2, dt**3
        transition = np.array([[1.0, dt, dt2 / 2.0], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
        walk = self._walk_density * np.array(
            [
                [dt3 * dt2 / 20.0, dt2 * dt2 / 8.0, dt3 / 6.0],
                [dt2 * dt2 / 8.0, dt3 / 3.0, dt2 / 2.0],
                [dt3 / 6.0, dt2 / 2.0, dt],
            ]
        )
        self._state = transition @ self._state
        self._covariance = transition @ self._covariance @ transition.T + walk

    def _correct(self, value):
        covariance = self._covariance
        gain = covariance[0] / (covariance[0, 0] + self._noise_variance)
        self._state = self._state + np.outer(gain, value - self._state[0])
        covariance = covariance - np.outer(gain, covariance[0])
        # Rounding makes the two halves drift apart.
        self._covariance = (covariance + covariance.T) / 2.0
