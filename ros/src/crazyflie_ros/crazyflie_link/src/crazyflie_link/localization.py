"""Poses measured by an external system, sent to one vehicle or packed for all of a channel."""

import math
import struct
import threading
from collections.abc import Callable, Mapping, Sequence

from cflib.crazyflie.localization import Localization as CflibLocalization
from cflib.crtp.crtpstack import CRTPPacket, CRTPPort
from cflib.utils.encoding import compress_quaternion

from crazyflie_link.broadcast import Broadcaster
from crazyflie_link.cflib_internals import packet
from crazyflie_link.errors import ValueRangeError
from crazyflie_link.link import Link
from crazyflie_link.subsystem import Subsystem, check_finite

#: Time for which the poses of one frame of the motion capture are collected, s.
FRAME_WINDOW = 0.005
MAX_POSITION = 32.767  #: Largest coordinate in a packed pose, m: 16 bits of mm.
POSES_PER_PACKET, POSITIONS_PER_PACKET = 2, 4  #: Largest numbers that fit in 30 bytes.

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
    port, poses_channel = CRTPPort.LOCALIZATION, CflibLocalization.GENERIC_CH
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
        """Queue a pose; it replaces an earlier one of the vehicle. Does not block."""
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


_STREAM = "localization"


class Localization(Subsystem):
    """Measured poses for the vehicle's estimator; nothing here blocks."""

    def __init__(self, current_link: Callable[[], Link]):
        super().__init__(current_link)
        self._packed: tuple[PackedPoses, int] | None = None

    def broadcast_by(self, packed: PackedPoses | None, vehicle_id: int = 0) -> None:
        """Send poses together with those of other vehicles; None sends them alone again."""
        self._packed = None if packed is None else (packed, vehicle_id)

    def position(self, x: float, y: float, z: float) -> None:
        """Send a position in the world, m."""
        check_finite("external position", x, y, z)
        link = self._current_link()
        if not self._pack((x, y, z), None):
            link.put_latest(_STREAM, lambda: link.cflib.loc.send_extpos((x, y, z)))

    def pose(self, position: Sequence[float], quaternion: Sequence[float]) -> None:
        """Send a position (m) and an attitude (x, y, z, w) in the world.

        The quaternion is normalised.
        """
        check_finite("external pose", *position, *quaternion)
        norm = math.hypot(*quaternion)
        if norm < 1e-6:
            raise ValueRangeError("external pose: the quaternion (0, 0, 0, 0) is no attitude")
        unit = [component / norm for component in quaternion]
        link = self._current_link()
        if not self._pack(position, unit):
            link.put_latest(_STREAM, lambda: link.cflib.loc.send_extpose(position, unit))

    def _pack(self, position, quaternion):
        if self._packed is None or max(map(abs, position)) > MAX_POSITION:
            return False
        packed, vehicle_id = self._packed
        packed.put(vehicle_id, (position, quaternion))
        return True
