"""Trajectories of polynomials, kept in the vehicle's memory and flown by its planner."""

import math
from collections.abc import Callable, Sequence
from typing import Self

from cflib.crazyflie.mem import CompressedSegment, CompressedStart, MemoryElement
from typing_extensions import override

from crazyflie_link.errors import ValueRangeError
from crazyflie_link.high_level import HighLevel
from crazyflie_link.link import Link
from crazyflie_link.subsystem import (
    MaySend,
    Subsystem,
    check_finite,
    check_positive,
    find_memory,
    write_memory,
)
from crazyflie_model.polynomials import COEFFICIENTS, PIECE_SIZE, PolynomialPiece

#: Duration (s), and control points of x, y, z (m) and yaw (rad).
Segment = tuple[float, Sequence[float], Sequence[float], Sequence[float], Sequence[float]]

_POINTS = (0, 1, 3, 7)
_MOST_METRES, _MOST_RADIANS = 32.767, math.radians(3276.7)
_MOST_SECONDS = 65.535


class Trajectories(Subsystem):
    """The vehicle's memory of trajectories."""

    def __init__(self, current_link: Callable[[], Link], high_level: HighLevel):
        super().__init__(current_link)
        self._high_level = high_level

    @override
    def guarded(self, may_send: MaySend) -> Self:
        guarded = super().guarded(may_send)
        guarded._high_level = self._high_level.guarded(may_send)
        return guarded

    def upload(
        self,
        trajectory_id: int,
        piece_offset: int,
        pieces: Sequence[PolynomialPiece],
        check: Callable[[], None] = lambda: None,
    ) -> None:
        """Write pieces to the vehicle's memory and define a trajectory (0 to 255) of them; blocks.

        The offset in the memory is counted in pieces. ``check()`` is called before every packet,
        and ends the upload by raising. Raises `CrazyflieError` if the pieces do not fit, the
        vehicle refuses them or does not reply.
        """
        if not pieces:
            raise ValueRangeError(f"trajectory {trajectory_id} has no pieces")
        link = self._current_link()
        memory = find_memory(link, MemoryElement.TYPE_TRAJ, "trajectories")
        begin = piece_offset * PIECE_SIZE
        if begin + len(pieces) * PIECE_SIZE > memory.size:
            raise ValueRangeError(
                f"trajectory {trajectory_id}: {len(pieces)} pieces from piece {piece_offset} on "
                f"do not fit: the vehicle has room for {memory.size // PIECE_SIZE}"
            )
        data = b"".join(map(_packed, pieces))
        self._write(link, memory.id, trajectory_id, begin, data, len(pieces), check)

    def upload_compressed(
        self,
        trajectory_id: int,
        offset: int,
        start: Sequence[float],
        segments: Sequence[Segment],
        check: Callable[[], None] = lambda: None,
    ) -> None:
        """Write a compressed trajectory from a byte of the memory on, and define it; blocks.

        It begins at ``start`` (x, y, z in m, yaw in rad). A segment is its duration (s), and the
        control points of a Bezier curve for x, y, z and yaw without the first: 0, 1, 3 or 7.
        """
        if not segments:
            raise ValueRangeError(f"trajectory {trajectory_id} has no segments; expected one")
        link = self._current_link()
        memory = find_memory(link, MemoryElement.TYPE_TRAJ, "trajectories")
        data = bytes(_packed_start(start))
        for number, segment in enumerate(segments):
            data += _packed_segment(number, *segment)
        # The firmware flies segments until one has no duration.
        data += bytes(CompressedSegment(0.0, [], [], [], []).pack())
        if offset + len(data) > memory.size:
            raise ValueRangeError(
                f"trajectory {trajectory_id}: {len(data)} bytes from byte {offset} on do not fit; "
                f"the vehicle has {memory.size}"
            )
        count = min(len(segments), 255)
        self._write(link, memory.id, trajectory_id, offset, data, count, check, is_compressed=True)

    def _write(self, link, memory, trajectory_id, begin, data, count, check, is_compressed=False):
        place = range(begin, begin + len(data))
        self._high_level.begin_upload(trajectory_id, place)
        write_memory(link, memory, begin, data, "the trajectory", check)
        check()
        self._high_level.define_trajectory(trajectory_id, place, count, is_compressed)


def _packed(piece: PolynomialPiece) -> bytes:
    check_positive("duration of a piece", piece.duration)
    for name, coefficients in zip(("x", "y", "z", "yaw"), piece.axes, strict=True):
        if len(coefficients) > COEFFICIENTS:
            raise ValueRangeError(
                f"polynomial of {name} has {len(coefficients)} coefficients; expected at "
                f"most {COEFFICIENTS}"
            )
        check_finite(f"polynomial of {name}", *coefficients)
    return piece.pack()


def _packed_start(start: Sequence[float]) -> bytes:
    for name, value in zip(("x", "y", "z", "yaw"), start, strict=True):
        _check_points(f"start: {name}", name, [value])
    return bytes(CompressedStart(*start).pack())


def _packed_segment(number: int, duration: float, *axes: Sequence[float]) -> bytes:
    what = f"segment {number}"
    if not 0.001 <= duration <= _MOST_SECONDS:
        raise ValueRangeError(
            f"{what}: its duration is {duration:g} s; expected 0.001 to {_MOST_SECONDS:g} s"
        )
    for name, points in zip(("x", "y", "z", "yaw"), axes, strict=True):
        if len(points) not in _POINTS:
            raise ValueRangeError(
                f"{what}: {name} has {len(points)} control points; expected 0, 1, 3 or 7"
            )
        _check_points(f"{what}: {name}", name, points)
    return bytes(CompressedSegment(duration, *axes).pack())


def _check_points(what, name, points):
    most, unit = (_MOST_RADIANS, "rad") if name == "yaw" else (_MOST_METRES, "m")
    for value in points:
        # One that is not a number is refused as well.
        if not abs(value) <= most:
            raise ValueRangeError(f"{what} is {value:g} {unit}; expected at most +-{most:.6g}")
