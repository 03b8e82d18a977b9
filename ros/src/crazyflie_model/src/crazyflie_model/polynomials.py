"""Pieces of trajectories: polynomials of the 7th degree in x, y, z and yaw."""

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple

from crazyflie_model.elementwise import Number

COEFFICIENTS = 8
"""Most coefficients of a polynomial, the constant first."""

PIECE_SIZE = 132
"""Bytes of a piece in the vehicle's memory: 4 times 8 coefficients and the duration, float32."""

_PIECE = struct.Struct("<33f")


class Goal(NamedTuple, Generic[Number]):
    """Where a trajectory is at some moment, or at many.

    Attributes
    ----------
    position, velocity, acceleration : tuple, 3 components
        m, m/s, m/s^2.
    yaw, yaw_rate : float or ndarray
        rad, rad/s.
    """

    position: tuple[Number, Number, Number]
    velocity: tuple[Number, Number, Number]
    acceleration: tuple[Number, Number, Number]
    yaw: Number
    yaw_rate: Number


@dataclass(frozen=True)
class PolynomialPiece:
    """One piece of a trajectory: four polynomials of the time since it began.

    Attributes
    ----------
    duration : float
        s.
    x, y, z, yaw : sequence of float
        Up to `COEFFICIENTS`, the constant first: m and rad, in powers of s.
    """

    duration: float
    x: Sequence[float]
    y: Sequence[float]
    z: Sequence[float]
    yaw: Sequence[float]

    @property
    def axes(self) -> tuple[Sequence[float], ...]:
        """The coefficients of x, y, z and yaw."""
        return (self.x, self.y, self.z, self.yaw)

    @classmethod
    def unpack(cls, data: bytes) -> "PolynomialPiece":
        """Return the piece in `PIECE_SIZE` bytes of the vehicle's memory.

        Raises
        ------
        ValueError
            It holds numbers that are not finite, or no positive duration.
        """
        numbers = _PIECE.unpack(data)
        if not all(map(math.isfinite, numbers)) or numbers[-1] <= 0.0:
            raise ValueError("a piece of a trajectory must be finite and last longer than 0 s")
        return cls(numbers[-1], *(numbers[i : i + COEFFICIENTS] for i in range(0, 32, 8)))

    def pack(self) -> bytes:
        """Return the piece as the vehicle's memory holds it."""
        padded = (c for axis in self.axes for c in [*axis, *[0.0] * (COEFFICIENTS - len(axis))])
        return _PIECE.pack(*padded, self.duration)

    def evaluate(self, time: Number) -> Goal[Number]:
        """Return the goal ``time`` (s) after the beginning, which is not limited."""
        values = [_evaluate(axis, time) for axis in self.axes]
        position, velocity, acceleration = zip(*values[:3], strict=True)
        return Goal(position, velocity, acceleration, values[3][0], values[3][1])


def _evaluate(coefficients, t):
    # Horner's scheme for the value and its first two derivatives.
    value = first = second = 0.0 * t
    for c in reversed(coefficients):
        second = second * t + first
        first = first * t + value
        value = value * t + c
    return value, first, 2.0 * second
