"""What a motion capture system makes of a pose on the way to the estimator."""

import math
from collections import deque

import numpy as np


class MotionCapture:
    """Poses as they are measured: with noise, some of them late, some never.

    Parameters
    ----------
    position_noise : float
        Standard deviation along each axis, m.
    attitude_noise : float
        Standard deviation of the rotation about each axis of the body, rad.
    latency : float
        Time from a measurement to its arrival, s.
    dropout : float
        Probability in [0, 1] that a pose is lost.
    seed : int or sequence of int
        The same seed gives the same errors to the same poses.
    """

    def __init__(
        self,
        position_noise: float = 0.0,
        attitude_noise: float = 0.0,
        latency: float = 0.0,
        dropout: float = 0.0,
        seed=0,
    ):
        self._position_noise = position_noise
        self._attitude_noise = attitude_noise
        self._latency = latency
        self._dropout = dropout
        self._random = np.random.default_rng(seed)
        self._on_the_way = deque()

    def measure(self, time: float, position, quaternion) -> None:
        """Measure the pose that holds at ``time`` (s).

        Parameters
        ----------
        time : float
            Later than at the call before, s; an earlier one is a reset of the
            clock, at which poses on the way are lost.
        position : sequence, 3 components
            m.
        quaternion : sequence, 4 components
            (x, y, z, w).
        """
        if self._on_the_way and time < self._on_the_way[-1][0]:
            self._on_the_way.clear()
        if self._dropout > 0.0 and self._random.random() < self._dropout:
            return
        if self._position_noise > 0.0:
            error = self._random.normal(0.0, self._position_noise, 3).tolist()
            position = tuple(a + b for a, b in zip(position, error, strict=True))
        if self._attitude_noise > 0.0:
            quaternion = _turn(quaternion, self._random.normal(0.0, self._attitude_noise, 3))
        self._on_the_way.append((time, position, quaternion))

    def arrivals(self, time: float) -> list:
        """Return the poses that have arrived since the call before, oldest first.

        Returns
        -------
        list of tuple
            Time of the measurement (s), position (m), quaternion (x, y, z, w).
        """
        arrived = []
        while self._on_the_way and self._on_the_way[0][0] + self._latency <= time + 1e-9:
            arrived.append(self._on_the_way.popleft())
        return arrived


def _turn(quaternion, rotation) -> tuple:
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
