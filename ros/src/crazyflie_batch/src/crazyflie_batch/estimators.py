"""The filters of `crazyflie_state_estimator`, by components: for floats or a batch.

The memory of a filter is a list of components, as states are; nothing is changed in place.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from numpy.typing import ArrayLike
from typing_extensions import override

from crazyflie_batch.per_vehicle import check_above
from crazyflie_model.elementwise import Vector, where
from crazyflie_state_estimator import motion


class _Differences:
    """Differences of positions, whose memory is the last position."""

    def start(self, value: Any) -> None:
        self.memory = value

    def step(self, dt: Any, value: Any) -> Any:
        rate = [(a - b) / dt for a, b in zip(value, self.memory, strict=True)]
        self.memory = value
        return value, rate


class _Filter(motion.ConstantAccelerationFilter):
    """The filter for floats or a batch, whose memory is a list of components."""

    @property
    def memory(self) -> Vector[Any]:
        return [*self.value, *self.rate, *self.acceleration, *self._covariance]

    @memory.setter
    def memory(self, memory: Vector[Any]) -> None:
        self.value, self.rate, self.acceleration = memory[:3], memory[3:6], memory[6:9]
        self._covariance = tuple(memory[9:])

    @override
    def step(self, dt: Any, value: Any, acceleration: Any = None) -> Any:
        before = self.memory
        self._begin(value, [(a - b) / dt for a, b in zip(value, self.value, strict=True)])
        restarted, self.memory = self.memory, before
        self.predict(dt)
        self.correct(value)
        is_late = dt > motion.MEMORY
        self.memory = [where(is_late, a, b) for a, b in zip(restarted, self.memory, strict=True)]
        return self.value, self.rate


@dataclass(frozen=True)
class Estimator:
    """A filter that finds position and velocity from positions.

    The fields of an object are parameters, by which vehicles may differ: each a float, or an array
    of shape (n,). The class calculates.
    """

    memory_dim: ClassVar[int]  #: Number of components of the memory.
    filter_type: ClassVar[type[Any]]  #: The filter of one vehicle, for the parameters' values.

    @classmethod
    def start(cls, position: Vector[Any], parameters: Sequence[Any]) -> Vector[Any]:
        """Return the memory after the first position, 3 components in m."""
        estimator = cls.filter_type(*parameters)
        estimator.start(position)
        return estimator.memory

    @classmethod
    def update(
        cls, memory: Vector[Any], dt: Any, position: Vector[Any], parameters: Sequence[Any]
    ) -> tuple[Vector[Any], Vector[Any], Vector[Any]]:
        """Return memory, position (m) and velocity (m/s) after the next position (3 components, m).

        ``dt`` is the time since the last one, s, positive.
        """
        estimator = cls.filter_type(*parameters)
        estimator.memory = memory
        position, velocity = estimator.step(dt, position)
        return estimator.memory, position, velocity


@dataclass(frozen=True)
class FiniteDifferences(Estimator):
    """See `crazyflie_state_estimator.motion.FiniteDifference`."""

    memory_dim = 3
    filter_type = _Differences


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
    filter_type = _Filter

    def __post_init__(self) -> None:
        check_above("noise", self.noise, 0.0)
        check_above("acceleration_walk", self.acceleration_walk, 0.0)
