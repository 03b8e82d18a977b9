"""Measured poses of several vehicles, packed in common packets."""

import struct
import threading
from collections.abc import Mapping, Sequence

from cflib.crazyflie.localization import Localization
from cflib.crtp.crtpstack import CRTPPacket, CRTPPort
from cflib.utils.encoding import compress_quaternion

from crazyflie_link.broadcast import Broadcaster
from crazyflie_link.safe_crazyflie import packet

#: How long the poses of one frame of the motion capture wait for each other, s.
FRAME_WINDOW = 0.005
MAX_POSITION = 32.767  #: Largest coordinate in a packed pose, m: 16 bits of mm.
POSES_PER_PACKET, POSITIONS_PER_PACKET = 2, 4  #: As many as fit in 30 bytes.

# Channel and type of packed poses and positions (crtp_localization_service.c).
_POSITIONS_CHANNEL = 2
_POSES_TYPE = 9

_POSE, _POSITION = struct.Struct("<B3hI"), struct.Struct("<B3h")
_STREAM = "poses"

#: Position (x, y, z, m) and unit quaternion (x, y, z, w), None if it is not known.
Pose = tuple[Sequence[float], Sequence[float] | None]


def pack(poses: Mapping[int, Pose]) -> list[CRTPPacket]:
    """Return the packets with the poses of vehicles, by the last byte of their addresses."""
    full, positions = [], []
    for vehicle_id, (position, quaternion) in poses.items():
        millimetres = (round(1000.0 * value) for value in position)
        if quaternion is None:
            positions.append(_POSITION.pack(vehicle_id, *millimetres))
        else:
            attitude = compress_quaternion(quaternion)
            full.append(_POSE.pack(vehicle_id, *millimetres, attitude))
    port, poses_channel = CRTPPort.LOCALIZATION, Localization.GENERIC_CH
    return [
        *(
            packet(port, poses_channel, bytes([_POSES_TYPE]) + b"".join(part))
            for part in _split(full, POSES_PER_PACKET)
        ),
        *(
            packet(port, _POSITIONS_CHANNEL, b"".join(part))
            for part in _split(positions, POSITIONS_PER_PACKET)
        ),
    ]


class PackedPoses:
    """Broadcasts the poses of the vehicles of a channel, those of a frame together."""

    def __init__(self, broadcaster: Broadcaster):
        #: Vehicles whose poses are expected; those of a frame are sent when all have come, or
        #: `FRAME_WINDOW` after the first.
        self.vehicles = 0
        self._broadcaster = broadcaster
        self._waiting: dict[int, Pose] = {}
        self._changed = threading.Condition()

    def put(self, vehicle_id: int, pose: Pose) -> None:
        """Have a pose sent; it replaces an earlier one of the vehicle. Does not block."""
        with self._changed:
            is_first = not self._waiting
            self._waiting[vehicle_id] = pose
            if self._is_complete():
                self._changed.notify()
        if is_first:
            self._broadcaster.put_latest(_STREAM, self._frame)

    def _is_complete(self):
        return len(self._waiting) >= self.vehicles

    def _frame(self):
        with self._changed:
            self._changed.wait_for(self._is_complete, FRAME_WINDOW)
            waiting, self._waiting = self._waiting, {}
        return pack(waiting)


def _split(items, size):
    return [items[begin : begin + size] for begin in range(0, len(items), size)]
