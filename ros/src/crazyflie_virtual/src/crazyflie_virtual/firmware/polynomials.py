"""Trajectories made of polynomials of the 7th degree in x, y, z and yaw."""

import math
import struct
from dataclasses import dataclass
from typing import NamedTuple

PIECE_SIZE = 132
"""Bytes of a piece in the trajectory memory: 4 times 8 coefficients and the duration, float32."""

_PIECE = struct.Struct("<33f")


class Goal(NamedTuple):
    """Where a trajectory is at some moment: position (m), velocity, acceleration, heading (rad)."""

    position: tuple
    velocity: tuple
    acceleration: tuple
    yaw: float
    yaw_rate: float


@dataclass(frozen=True)
class Piece:
    """One piece of a trajectory.

    Attributes
    ----------
    axes : tuple of tuple
        Coefficients in x, y, z (m) and yaw (rad), lowest power of the time (s) first.
    duration : float
        s.
    """

    axes: tuple
    duration: float

    @classmethod
    def unpack(cls, data: bytes) -> "Piece":
        """Return the piece in `PIECE_SIZE` bytes of trajectory memory.

        Raises
        ------
        ValueError
            It holds numbers that are not finite, or no positive duration.
        """
        numbers = _PIECE.unpack(data)
        if not all(map(math.isfinite, numbers)) or numbers[-1] <= 0.0:
            raise ValueError("a piece of a trajectory must be finite and last longer than 0 s")
        return cls(tuple(numbers[i : i + 8] for i in range(0, 32, 8)), numbers[-1])

    def pack(self) -> bytes:
        """Return the piece as it is in trajectory memory."""
        return _PIECE.pack(*(c for axis in self.axes for c in axis), self.duration)

    def evaluate(self, time: float) -> Goal:
        """Return the goal ``time`` (s) after the beginning, which is not limited."""
        values = [_evaluate(axis, time) for axis in self.axes]
        return Goal(
            tuple(value[0] for value in values[:3]),
            tuple(value[1] for value in values[:3]),
            tuple(value[2] for value in values[:3]),
            values[3][0],
            values[3][1],
        )


def _evaluate(coefficients, t):
    # Horner's scheme for the value and its first two derivatives.
    value = first = second = 0.0
    for c in reversed(coefficients):
        second = second * t + first
        first = first * t + value
        value = value * t + c
    return value, first, 2.0 * second


def smooth_piece(start: Goal, position: tuple, yaw: float, duration: float) -> Piece:
    """Return the piece from a goal to rest at a position (m) and heading (rad).

    Each axis is the polynomial of the 7th degree that meets position, velocity,
    acceleration and jerk (zero) at both ends, heading without acceleration. From
    rest to rest this is 35 s^4 - 84 s^5 + 70 s^6 - 20 s^7 of the way.

    Parameters
    ----------
    start : Goal
    position : tuple, 3 components
    yaw : float
        The turn is the shorter one.
    duration : float
        s, > 0.
    """
    turn = math.remainder(yaw - start.yaw, 2.0 * math.pi)
    axes = [
        _between(p, v, a, end, duration)
        for p, v, a, end in zip(
            start.position, start.velocity, start.acceleration, position, strict=True
        )
    ]
    axes.append(_between(start.yaw, start.yaw_rate, 0.0, start.yaw + turn, duration))
    return Piece(tuple(axes), duration)


def straight_piece(start: Goal, position: tuple, yaw: float, duration: float) -> Piece:
    """Return the piece that goes there at constant speed; see `smooth_piece`."""
    turn = math.remainder(yaw - start.yaw, 2.0 * math.pi)
    ends = (*position, start.yaw + turn)
    starts = (*start.position, start.yaw)
    axes = tuple(
        (a, (b - a) / duration, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        for a, b in zip(starts, ends, strict=True)
    )
    return Piece(axes, duration)


def _between(p, v, a, end, duration):
    # In units of the duration: what the four highest powers have to add at the
    # end to value, slope and curvature (the jerk is zero at both ends).
    v, a = v * duration, a * duration**2
    h, hv, ha = end - p - v - a / 2.0, -v - a, -a
    scaled = (
        p,
        v,
        a / 2.0,
        0.0,
        35.0 * h - 15.0 * hv + 2.5 * ha,
        -84.0 * h + 39.0 * hv - 7.0 * ha,
        70.0 * h - 34.0 * hv + 6.5 * ha,
        -20.0 * h + 10.0 * hv - 2.0 * ha,
    )
    return tuple(c / duration**power for power, c in enumerate(scaled))


@dataclass(frozen=True)
class Trajectory:
    """Pieces flown one after the other, then the last position.

    Attributes
    ----------
    pieces : tuple of Piece
        At least one.
    time_scale : float
        > 0; 2 is half as fast.
    backwards : bool
        From the end to the beginning.
    shift : tuple, 3 components
        Added to all positions, m.
    turn : float
        By which all is turned about the first position, rad.
    """

    pieces: tuple
    time_scale: float = 1.0
    backwards: bool = False
    shift: tuple = (0.0, 0.0, 0.0)
    turn: float = 0.0

    @property
    def duration(self) -> float:
        """How long it takes, s."""
        return self.time_scale * sum(piece.duration for piece in self.pieces)

    def moved_to(self, position: tuple, yaw: float | None) -> "Trajectory":
        """Return the trajectory beginning at a position (m) and, unless None, heading (rad)."""
        start = self._unmoved(0.0)
        shift = tuple(a - b for a, b in zip(position, start.position, strict=True))
        turn = 0.0 if yaw is None else math.remainder(yaw - start.yaw, 2.0 * math.pi)
        return Trajectory(self.pieces, self.time_scale, self.backwards, shift, turn)

    def evaluate(self, time: float) -> Goal:
        """Return the goal ``time`` (s) after the beginning."""
        goal = self._unmoved(time)
        pivot = self._unmoved(0.0).position if self.turn else (0.0, 0.0, 0.0)
        offset = tuple(a - b for a, b in zip(goal.position, pivot, strict=True))
        position = tuple(
            a + b + c for a, b, c in zip(self._turned(offset), pivot, self.shift, strict=True)
        )
        return Goal(
            position,
            self._turned(goal.velocity),
            self._turned(goal.acceleration),
            goal.yaw + self.turn,
            goal.yaw_rate,
        )

    def _turned(self, vector):
        c, s = math.cos(self.turn), math.sin(self.turn)
        return (c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2])

    def _unmoved(self, time):
        total = self.duration
        over = time >= total
        time = min(max(time, 0.0), total)
        local = (total - time if self.backwards else time) / self.time_scale
        for piece in self.pieces[:-1]:
            if local <= piece.duration:
                break
            local -= piece.duration
        else:
            piece = self.pieces[-1]
        goal = piece.evaluate(min(local, piece.duration))
        if over:
            return Goal(goal.position, (0.0,) * 3, (0.0,) * 3, goal.yaw, 0.0)
        rate = (-1.0 if self.backwards else 1.0) / self.time_scale
        return Goal(
            goal.position,
            tuple(rate * v for v in goal.velocity),
            tuple(rate * rate * a for a in goal.acceleration),
            goal.yaw,
            rate * goal.yaw_rate,
        )
