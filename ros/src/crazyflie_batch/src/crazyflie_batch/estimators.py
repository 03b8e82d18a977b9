"""The filters of `crazyflie_state_estimator`, by components: for floats or a batch.

The memory of a filter is a list of components, as states are; nothing is changed in place.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import override

from crazyflie_batch.per_vehicle import check_above
from crazyflie_model.elementwise import Vector, where
from crazyflie_state_estimator import motion


@dataclass(frozen=True)
class Estimator(ABC):
    """A filter that finds position and velocity from positions.

    The fields of an object are parameters, by which vehicles may differ: each a float, or an array
    of shape (n,). The class calculates.
    """

    memory_dim: ClassVar[int]  #: Number of components of the memory.

    @classmethod
    @abstractmethod
    def start(cls, position: Vector[Any], parameters: Sequence[Any]) -> Vector[Any]:
        """Return the memory after the first position, 3 components in m."""

    @classmethod
    @abstractmethod
    def update(
        cls, memory: Vector[Any], dt: Any, position: Vector[Any], parameters: Sequence[Any]
    ) -> tuple[Vector[Any], Vector[Any], Vector[Any]]:
        """Return memory, position (m) and velocity (m/s) after the next position (3 components, m).

        ``dt`` is the time since the last one, s, positive.
        """


@dataclass(frozen=True)
class FiniteDifferences(Estimator):
    """See `crazyflie_state_estimator.motion.FiniteDifference`."""

    memory_dim = 3

    @classmethod
    @override
    def start(cls, position: Vector[Any], parameters: Sequence[Any]) -> Vector[Any]:
        return position

    @classmethod
    @override
    def update(
        cls, memory: Vector[Any], dt: Any, position: Vector[Any], parameters: Sequence[Any]
    ) -> tuple[Vector[Any], Vector[Any], Vector[Any]]:
        return position, position, [(a - b) / dt for a, b in zip(position, memory, strict=True)]


@dataclass(frozen=True)
class Kalman(Estimator):
    """See `crazyflie_state_estimator.motion.ConstantAccelerationFilter`; without the control.

    Memory: position (3), velocity (3), acceleration (3), and the covariance that the axes share,
    upper half by rows (6). ValueError: one of the deviations is not positive.
    """

    #: Float or ndarray, shape (n,). Standard deviation of the poses' coordinates, m.
    noise: ArrayLike = motion.POSITION_NOISE
    #: Float or ndarray, shape (n,); m/s^2/sqrt(s).
    acceleration_walk: ArrayLike = motion.ACCELERATION_WALK
    memory_dim = 15

    def __post_init__(self) -> None:
        check_above("noise", self.noise, 0.0)
        check_above("acceleration_walk", self.acceleration_walk, 0.0)

    @classmethod
    @override
    def start(cls, position: Vector[Any], parameters: Sequence[Any]) -> Vector[Any]:
        return _begin(position, [0.0] * 3, parameters[0])

    @classmethod
    @override
    def update(
        cls, memory: Vector[Any], dt: Any, position: Vector[Any], parameters: Sequence[Any]
    ) -> tuple[Vector[Any], Vector[Any], Vector[Any]]:
        noise, walk = parameters
        speeds = [(a - b) / dt for a, b in zip(position, memory[:3], strict=True)]
        restarted = _begin(position, speeds, noise)
        state, covariance = _predict(memory[:9], memory[9:], dt, walk * walk)
        state, covariance = _correct(state, covariance, position, noise * noise)
        is_late = dt > motion.MEMORY
        memory = [where(is_late, a, b) for a, b in zip(restarted, state + covariance, strict=True)]
        return memory, memory[:3], memory[3:6]


def _first_variances():
    """Return the variances of rate and acceleration in a filter that has seen one sample."""
    filter_ = motion.ConstantAccelerationFilter(1.0, 1.0)
    filter_.start([0.0])
    return np.diag(filter_.covariance)[1:].tolist()


_RATE_VARIANCE, _ACCELERATION_VARIANCE = _first_variances()


def _begin(position, velocity, noise):
    """Return the memory of a filter that knows next to nothing about rate and acceleration."""
    covariance = [noise * noise, 0.0, 0.0, _RATE_VARIANCE, 0.0, _ACCELERATION_VARIANCE]
    return [*position, *velocity, 0.0, 0.0, 0.0, *covariance]


def _predict(state, covariance, dt, walk):
    """Return state and covariance ``dt`` later; F P F' + Q written out."""
    dt2, dt3 = dt**2, dt**3
    half = dt2 / 2.0
    p, v, a = state[:3], state[3:6], state[6:9]
    p = [p[axis] + dt * v[axis] + half * a[axis] for axis in range(3)]
    v = [v[axis] + dt * a[axis] for axis in range(3)]
    pp, pv, pa, vv, va, aa = covariance
    # F P, as far as it is needed.
    fp_p, fp_v, fp_a = pp + dt * pv + half * pa, pv + dt * vv + half * va, pa + dt * va + half * aa
    fv_v, fv_a = vv + dt * va, va + dt * aa
    return [*p, *v, *a], [
        fp_p + dt * fp_v + half * fp_a + walk * (dt3 * dt2 / 20.0),
        fp_v + dt * fp_a + walk * (dt2 * dt2 / 8.0),
        fp_a + walk * (dt3 / 6.0),
        fv_v + dt * fv_a + walk * (dt3 / 3.0),
        fv_a + walk * half,
        aa + walk * dt,
    ]


def _correct(state, covariance, position, noise_variance):
    pp, pv, pa, vv, va, aa = covariance
    gains = [part / (pp + noise_variance) for part in (pp, pv, pa)]
    innovation = [position[axis] - state[axis] for axis in range(3)]
    state = [state[i] + gains[i // 3] * innovation[i % 3] for i in range(9)]
    g, h, k = gains
    covariance = [pp - g * pp, pv - g * pv, pa - g * pa, vv - h * pv, va - h * pa, aa - k * pa]
    return state, covariance
