"""Trajectories of polynomial pieces, and the curve from rest to rest with the least jerk."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from crazyflie_model.angles import Triple
from crazyflie_model.elementwise import Number, clip, where
from crazyflie_model.polynomials import Goal, PolynomialPiece

#: Pieces flown one after the other, as in CSV files of crazyflie_demo and in a vehicle's memory.
Pieces = Sequence[PolynomialPiece]


def minimum_jerk(s: Number) -> tuple[Number, Number]:
    """Return 10 s^3 - 15 s^4 + 6 s^5 and its derivative, for s from 0 to 1.

    Of all curves from 0 to 1 that begin and end at rest without acceleration, the one with
    the least jerk (Flash and Hogan, The coordination of arm movements, 1985). The derivative
    is `MINIMUM_JERK_SPEED` at most, the second `MINIMUM_JERK_ACCELERATION`.
    """
    value = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
    return value, 30.0 * s * s * (1.0 - s) ** 2


MINIMUM_JERK_SPEED = 15.0 / 8.0
MINIMUM_JERK_ACCELERATION = 10.0 / math.sqrt(3.0)


def duration(pieces: Pieces) -> float:
    """Return the duration of pieces, s."""
    return sum(piece.duration for piece in pieces)


def stretched(pieces: Pieces, factor: float) -> list[PolynomialPiece]:
    """Return the same path in ``factor`` times the time, as other pieces."""
    return [
        PolynomialPiece(
            piece.duration * factor,
            *([c / factor**k for k, c in enumerate(axis)] for axis in piece.axes),
        )
        for piece in pieces
    ]


def moved(pieces: Pieces, offset: Triple) -> list[PolynomialPiece]:
    """Return pieces with an offset (x, y, z), m, added to all positions."""

    def move(piece):
        *axes, yaw = piece.padded_axes
        x, y, z = ([axis[0] + d, *axis[1:]] for axis, d in zip(axes, offset, strict=True))
        return PolynomialPiece(piece.duration, x, y, z, yaw)

    return [move(piece) for piece in pieces]


def turned(pieces: Pieces, pivot: Triple, angle: float) -> list[PolynomialPiece]:
    """Return pieces turned by an angle (rad) about the vertical through a point (m)."""
    c, s = math.cos(angle), math.sin(angle)

    def turn(piece):
        x, y, z, yaw = piece.padded_axes
        turned_x = [c * a - s * b for a, b in zip(x, y, strict=True)]
        turned_y = [s * a + c * b for a, b in zip(x, y, strict=True)]
        return PolynomialPiece(piece.duration, turned_x, turned_y, z, [yaw[0] + angle, *yaw[1:]])

    x, y, z = pivot
    about_origin = [turn(piece) for piece in moved(pieces, (-x, -y, -z))]
    return moved(about_origin, pivot)


@dataclass(frozen=True)
class Trajectory:
    """Pieces flown one after the other, then rest at the last position."""

    pieces: Pieces  #: At least one.
    time_scale: float = 1.0  #: Factor of the duration, > 0; 2 is half as fast.
    backwards: bool = False  #: Whether it is flown from the end to the beginning.

    @property
    def duration(self) -> float:
        """Time from the beginning to the end, s."""
        return self.time_scale * duration(self.pieces)

    def moved_to(self, position: Triple, yaw: float | None) -> "Trajectory":
        """Return the trajectory beginning at a position (m) and, unless None, heading (rad)."""
        start = self.evaluate(0.0)
        pieces = self.pieces
        if yaw is not None:
            turn = math.remainder(yaw - start.yaw, 2.0 * math.pi)
            pieces = turned(pieces, start.position, turn)
        x, y, z = (a - b for a, b in zip(position, start.position, strict=True))
        return replace(self, pieces=moved(pieces, (x, y, z)))

    def evaluate(self, time: Number) -> Goal[Number]:
        """Return the goal ``time`` (s) after the beginning, at rest from the end on."""
        total = self.duration
        is_over = time >= total
        time = clip(time, 0.0, total)
        piece, local = self._piece_at((total - time if self.backwards else time) / self.time_scale)
        goal = piece.evaluate(local)
        if is_over is False and self.time_scale == 1.0 and not self.backwards:
            return goal
        rate = (-1.0 if self.backwards else 1.0) / self.time_scale
        vx, vy, vz = (where(is_over, 0.0, rate * v) for v in goal.velocity)
        ax, ay, az = (where(is_over, 0.0, rate * rate * a) for a in goal.acceleration)
        yaw_rate = where(is_over, 0.0, rate * goal.yaw_rate)
        return Goal(goal.position, (vx, vy, vz), (ax, ay, az), goal.yaw, yaw_rate)

    def _piece_at(self, time):
        """Return the piece of a time since the beginning and the time in it.

        For n times it is one piece with coefficients of shape (n,).
        """
        if isinstance(time, float):
            for piece in self.pieces[:-1]:
                if time <= piece.duration:
                    break
                time -= piece.duration
            else:
                piece = self.pieces[-1]
            return piece, min(time, piece.duration)
        durations = np.array([piece.duration for piece in self.pieces])
        begins = np.concatenate([[0.0], np.cumsum(durations)[:-1]])
        index = np.searchsorted(begins[1:], time)
        axes = np.array([piece.padded_axes for piece in self.pieces])[index]
        piece = PolynomialPiece(durations[index], *np.moveaxis(axes, 0, -1))
        return piece, np.minimum(time - begins[index], piece.duration)
