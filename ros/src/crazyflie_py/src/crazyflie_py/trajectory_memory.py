"""The trajectory memory of an ideal vehicle: that of the firmware's planner, with messages."""

from collections.abc import Callable, Sequence

from crazyflie_model.polynomials import PIECE_SIZE, PolynomialPiece
from crazyflie_virtual.firmware.planner import (
    DEFINITIONS,
    IN_MEMORY,
    MEMORY_SIZE,
    POLYNOMIALS,
    Planner,
)

_ROOM = MEMORY_SIZE // PIECE_SIZE  #: Pieces that the memory holds.


class TrajectoryMemory:
    """Trajectories by the ids of scripts, which go to 255; those of the firmware go to 30.

    Parameters
    ----------
    name : str
        Of the vehicle.
    planner : Planner
    warn : callable
        Gets a text.
    """

    def __init__(self, name: str, planner: Planner, warn: Callable[[str], None]):
        self._name = name
        self._planner = planner
        self._warn = warn
        self._slots: dict[int, tuple[int, range]] = {}

    def upload(
        self, trajectory_id: int, piece_offset: int, pieces: Sequence[PolynomialPiece]
    ) -> None:
        """Write pieces; ValueError when there is no room."""
        where = f"{self._name}.uploadTrajectory"
        room = range(piece_offset, piece_offset + len(pieces))
        if room.stop > _ROOM:
            raise ValueError(
                f"{where}: {len(pieces)} pieces from pieceOffset {piece_offset} on; expected no "
                f"more than {_ROOM} in all, the room in the memory"
            )
        slot = self._slots.get(trajectory_id, (len(self._slots), room))[0]
        if slot >= DEFINITIONS:
            raise ValueError(
                f"{where}: trajectoryId is {trajectory_id}; expected one of the {DEFINITIONS} that "
                f"are in use: {sorted(self._slots)}"
            )
        if trajectory_id >= DEFINITIONS:
            self._warn(
                f"{where}: trajectoryId is {trajectory_id}; a real vehicle refuses it, the "
                f"firmware expects 0 to {DEFINITIONS - 1}"
            )
        for other, (_, taken) in self._slots.items():
            if other != trajectory_id and set(taken) & set(room):
                self._warn(
                    f"{where}: pieces {room.start} to {room.stop - 1} overwrite trajectory "
                    f"{other}; another pieceOffset keeps both"
                )
        self._slots[trajectory_id] = slot, room
        begin = piece_offset * PIECE_SIZE
        data = b"".join(piece.pack() for piece in pieces)
        self._planner.memory[begin : begin + len(data)] = data
        self._planner.define(slot, IN_MEMORY, POLYNOMIALS, begin, len(pieces))

    def slot(self, trajectory_id: int) -> int:
        """Return the planner's number of a trajectory; ValueError for one that is not there."""
        if trajectory_id not in self._slots:
            raise ValueError(
                f"{self._name}.startTrajectory: trajectoryId is {trajectory_id}; expected one that "
                f"uploadTrajectory has written: {sorted(self._slots) or 'there is none'}"
            )
        return self._slots[trajectory_id][0]
