"""Errors of a motion capture system."""

from __future__ import annotations

import functools
import math
from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.random import Generator, default_rng
from numpy.typing import NDArray

from crazyflie_model.angles import Quaternion, Triple

#: Time of a measurement (s), position (m), quaternion (x, y, z, w).
Pose = tuple[float, Triple, Quaternion]


class MotionCapture:
    """Measured poses: with noise, latency and dropouts.

    All attributes may be changed at any time. The same ``seed`` gives the same errors to the same
    poses.
    """

    def __init__(
        self,
        position_noise: float = 0.0,
        attitude_noise: float = 0.0,
        latency: float = 0.0,
        dropout: float = 0.0,
        seed: int | Sequence[int] = 0,
    ):
        #: Standard deviation of the position along each axis (m). Standard deviation of the
        #: rotation about each axis of the body (rad).
        self.position_noise = position_noise
        self.attitude_noise = attitude_noise
        self.latency = latency  #: Time from a measurement to its arrival (s).
        self.dropout = dropout  #: Probability in [0, 1] that a pose is lost.
        self._seed = seed
        self._in_transit: deque[Pose] = deque()

    @functools.cached_property
    def _random(self) -> Generator:
        return default_rng(self._seed)

    @property
    def is_perfect(self) -> bool:
        """Whether poses arrive without errors and latency."""
        errors = (self.position_noise, self.attitude_noise, self.latency, self.dropout)
        return not (any(errors) or self._in_transit)

    def measure(self, time: float, position: Triple, quaternion: Quaternion) -> None:
        """Measure the pose at ``time`` (s): position (m) and quaternion (x, y, z, w).

        A time before that of the last call is a reset of the clock: poses in transit are lost.
        """
        if self._in_transit and time < self._in_transit[-1][0]:
            self._in_transit.clear()
        if self.dropout > 0.0 and self._random.random() < self.dropout:
            return
        if self.position_noise > 0.0:
            error = self._random.normal(0.0, self.position_noise, 3).tolist()
            x, y, z = (a + b for a, b in zip(position, error, strict=True))
            position = (x, y, z)
        if self.attitude_noise > 0.0:
            quaternion = _turn(quaternion, self._random.normal(0.0, self.attitude_noise, 3))
        self._in_transit.append((time, position, quaternion))

    def arrivals(self, time: float) -> list[Pose]:
        """Return the poses that have arrived since the last call, oldest first."""
        arrived = []
        while self._in_transit and self._in_transit[0][0] + self.latency <= time + 1e-9:
            arrived.append(self._in_transit.popleft())
        return arrived


def _turn(quaternion: Quaternion, rotation: NDArray[np.float64]) -> Quaternion:
    # The quaternion's product with that of a rotation vector in the body frame.
    x, y, z, w = quaternion
    angle = math.hypot(*rotation)
    factor = math.sin(angle / 2.0) / angle if angle > 0.0 else 0.5
    a, b, c = (factor * float(part) for part in rotation)
    d = math.cos(angle / 2.0)
    return (
        w * a + x * d + y * c - z * b,
        w * b - x * c + y * d + z * a,
        w * c + x * b - y * a + z * d,
        w * d - x * a - y * b - z * c,
    )
