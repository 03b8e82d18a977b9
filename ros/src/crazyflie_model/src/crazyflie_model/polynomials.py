"""Polynomials of time: evaluation, interpolation, and the pieces that trajectories are made of."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Generic, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from crazyflie_model.elementwise import Number

COEFFICIENTS = 8  #: Largest number of coefficients of a polynomial, the constant first.
#: Bytes of a piece in the vehicle's memory: 4 times 8 coefficients and the duration, float32.
PIECE_SIZE = 132

_PIECE = struct.Struct("<33f")


def evaluate(
    coefficients: Sequence[Number] | NDArray[np.float64], t: Number, derivatives: int = 2
) -> list[Number]:
    """Return the value at t and derivatives of a polynomial, by Horner's scheme.

    The constant is the first of its coefficients.
    """
    if derivatives == 2:
        # The loop below, without its inner loop: trajectories are evaluated at each reference.
        value = first = half = 0.0 * t
        for c in reversed(coefficients):
            half, first, value = half * t + first, first * t + value, value * t + c
        return [value, first, 2 * half]
    terms = [0.0 * t] * (derivatives + 1)
    for c in reversed(coefficients):
        for k in range(derivatives, 0, -1):
            terms[k] = terms[k] * t + terms[k - 1]
        terms[0] = terms[0] * t + c
    return [math.factorial(k) * term for k, term in enumerate(terms)]


def shifted(coefficients: Sequence[float], time: float) -> list[float]:
    """Return the coefficients of the same polynomial, of the time since ``time`` (s)."""
    terms = evaluate(coefficients, time, len(coefficients) - 1)
    return [term / math.factorial(k) for k, term in enumerate(terms)]


def hermite(start: Sequence[float], end: Sequence[float], duration: float) -> tuple[float, ...]:
    """Return the coefficients, the constant first, of the polynomial between two ends.

    An end is value and derivatives by time; four at both make a polynomial of the 7th degree.
    ``duration`` is the time between them, s, > 0.
    """
    degree = len(start) + len(end) - 1
    # Seen from the end, time runs backwards.
    first = _control_points(start, duration, degree)
    last = _control_points(end, -duration, degree)
    return bezier([*first, *reversed(last)], duration)


def _control_points(derivatives, duration, degree):
    """Return the first control points of the Bezier curve of a degree with these derivatives.

    The k-th derivative at the beginning is degree! / (degree - k)! / duration^k times the k-th
    difference of the control points (Farin, Curves and Surfaces for CAGD, section 5.3).
    """
    differences, scale = [], 1.0
    for k, derivative in enumerate(derivatives):
        differences.append(derivative * scale / math.perm(degree, k))
        scale *= duration
    return [
        sum(math.comb(j, k) * differences[k] for k in range(j + 1)) for j in range(len(differences))
    ]


def bezier(points: Sequence[float], duration: float) -> tuple[float, ...]:
    """Return the coefficients, the constant first, of the Bezier curve of n control points.

    It has degree n - 1; ``duration`` (s, > 0) is the time from the first to the last point. The
    coefficient of (t / duration)^k is C(n - 1, k) times the k-th difference of the points.
    """
    degree = len(points) - 1
    coefficients = []
    differences = list(points)
    for k in range(degree + 1):
        coefficient = math.comb(degree, k) * differences[0]
        # Divided one after the other: a power of the duration may be 0 or infinite.
        for _ in range(k):
            coefficient /= duration
        coefficients.append(coefficient)
        differences = [b - a for a, b in pairwise(differences)]
    return tuple(coefficients)


class Goal(NamedTuple, Generic[Number]):
    """Position and heading of a trajectory, with derivatives, at one time or at many."""

    #: position, velocity, acceleration: x, y, z in m, m/s and m/s^2.
    position: tuple[Number, Number, Number]
    velocity: tuple[Number, Number, Number]
    acceleration: tuple[Number, Number, Number]
    #: yaw, yaw_rate: Heading and its rate (rad and rad/s).
    yaw: Number
    yaw_rate: Number


def at_rest(position: Sequence[float], yaw: float = 0.0) -> Goal[float]:
    """Return the goal of a vehicle that stays at a position (m) and heading (rad)."""
    x, y, z = position
    return Goal((x, y, z), (0.0,) * 3, (0.0,) * 3, yaw, 0.0)


@dataclass(frozen=True)
class PolynomialPiece:
    """One piece of a trajectory: four polynomials of the time since it began."""

    duration: float  #: Duration (s).
    #: x, y, z, yaw: Up to `COEFFICIENTS`, the constant first: m and rad, in powers of s.
    x: Sequence[float]
    y: Sequence[float]
    z: Sequence[float]
    yaw: Sequence[float]

    @property
    def axes(self) -> tuple[Sequence[float], ...]:
        """The coefficients of x, y, z and yaw."""
        return (self.x, self.y, self.z, self.yaw)

    @property
    def padded_axes(self) -> list[list[float]]:
        """The coefficients of x, y, z and yaw, `COEFFICIENTS` of each."""
        return [[*axis, *[0.0] * (COEFFICIENTS - len(axis))] for axis in self.axes]

    @classmethod
    def unpack(cls, data: bytes) -> Self:
        """Return the piece in `PIECE_SIZE` bytes of the vehicle's memory.

        Memory that was never written is a piece without duration, at the origin. ValueError for
        numbers that are not finite, or a negative duration.
        """
        *numbers, duration = _PIECE.unpack(data)
        if not all(map(math.isfinite, numbers)) or not 0.0 <= duration < math.inf:
            raise ValueError("the piece has numbers that are not finite, or a negative duration")
        return cls(duration, *(numbers[i : i + COEFFICIENTS] for i in range(0, 32, 8)))

    def pack(self) -> bytes:
        """Return the piece in the format of the vehicle's memory."""
        return _PIECE.pack(*(c for axis in self.padded_axes for c in axis), self.duration)

    def evaluate(self, time: Number) -> Goal[Number]:
        """Return the goal ``time`` (s) after the beginning, which is not limited."""
        *axes, yaw = (evaluate(axis, time) for axis in self.axes)
        position, velocity, acceleration = zip(*axes, strict=True)
        return Goal(position, velocity, acceleration, yaw[0], yaw[1])
