"""Trajectories of polynomials, kept in the vehicle's memory and flown by its planner."""

import struct
from collections.abc import Callable, Sequence
from typing import Self

from cflib.crazyflie.mem import CHAN_WRITE, MemoryElement, _WriteRequest
from cflib.crtp.crtpstack import CRTPPort
from typing_extensions import override

from crazyflie_link.checks import check_finite, check_positive
from crazyflie_link.errors import RefusedError, ValueRangeError
from crazyflie_link.high_level import HighLevel
from crazyflie_link.link import Link
from crazyflie_link.request_reply import Request
from crazyflie_link.subsystem import MaySend, Subsystem
from crazyflie_model.polynomials import COEFFICIENTS, PIECE_SIZE, PolynomialPiece

_CHUNK = _WriteRequest.MAX_DATA_LENGTH


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
        memory = _memory(link)
        begin = piece_offset * PIECE_SIZE
        end = begin + len(pieces) * PIECE_SIZE
        if end > memory.size:
            raise ValueRangeError(
                f"trajectory {trajectory_id}: {len(pieces)} pieces from piece {piece_offset} on "
                f"do not fit: the vehicle has room for {memory.size // PIECE_SIZE}"
            )
        data = b"".join(map(_packed, pieces))
        self._high_level.begin_upload(trajectory_id, begin, end)
        for start in range(0, len(data), _CHUNK):
            check()
            _write(link, memory.id, begin + start, data[start : start + _CHUNK])
        check()
        self._high_level.define_trajectory(trajectory_id, begin, len(pieces))


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


def _memory(link):
    memories = link.cflib.mem.get_mems(MemoryElement.TYPE_TRAJ)
    if not memories:
        raise RefusedError("the vehicle has no memory for trajectories: update its firmware")
    return memories[0]


def _write(link: Link, memory_id: int, address: int, data: bytes) -> None:
    # cflib's own writer never ends when a reply comes twice.
    where = struct.pack("<BI", memory_id, address)
    what = f"writing the trajectory, byte {address}"
    answer = link.request(where + data, Request(CRTPPort.MEM, CHAN_WRITE, where, what))
    status = answer[5] if len(answer) > 5 else 0
    if status:
        raise RefusedError(f"{what}: the vehicle refuses it (error {status})")
