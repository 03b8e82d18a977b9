"""Where a vehicle is: poses from an external system, and base stations of Lighthouse.

Poses are sent to one vehicle, or packed for all of a channel. The geometry and the calibration of
base stations are in the vehicle, which measures angles to them.
"""

import itertools
import math
import queue
import struct
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from cflib.crazyflie.localization import Localization as CflibLocalization
from cflib.crazyflie.mem import (
    LighthouseBsCalibration,
    LighthouseBsGeometry,
    LighthouseMemHelper,
    LighthouseMemory,
    MemoryElement,
)
from cflib.crtp.crtpstack import CRTPPacket, CRTPPort
from cflib.localization import LighthouseConfigFileManager, LighthouseSweepAngleAverageReader
from cflib.localization.lighthouse_bs_vector import LighthouseBsVectors
from cflib.utils.encoding import compress_quaternion

from crazyflie_link.broadcast import Broadcaster
from crazyflie_link.cflib_internals import packet
from crazyflie_link.errors import (
    CrazyflieError,
    NoReplyError,
    RefusedError,
    ValueRangeError,
)
from crazyflie_link.firmware_parameters import FirmwareParameters
from crazyflie_link.link import Link
from crazyflie_link.subsystem import (
    Subsystem,
    check_finite,
    find_memory,
    has_memory,
    write_memory,
)
from crazyflie_link.transmission import Request
from crazyflie_utils.parameters import yaml_file
from crazyflie_utils.parameters.declaration import ParameterError

#: Time for which the poses of one frame of the motion capture are collected, s.
FRAME_WINDOW = 0.005
MAX_POSITION = 32.767  #: Largest coordinate in a packed pose, m: 16 bits of mm.
POSES_PER_PACKET, POSITIONS_PER_PACKET = 2, 4  #: Largest numbers that fit in 30 bytes.

_POSITIONS_CHANNEL = 2  #: Channel of packed positions (crtp_localization_service.c).
_POSE, _POSITION = struct.Struct("<B3hI"), struct.Struct("<B3h")
_STREAM = "localization"

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
    port, poses_type = CRTPPort.LOCALIZATION, bytes([CflibLocalization.EXT_POSE_PACKED])
    return [
        packet(port, channel, kind + b"".join(entries[begin : begin + size]))
        for channel, kind, entries, size in (
            (CflibLocalization.GENERIC_CH, poses_type, full, POSES_PER_PACKET),
            (_POSITIONS_CHANNEL, b"", positions, POSITIONS_PER_PACKET),
        )
        for begin in range(0, len(entries), size)
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
            self._waiting[vehicle_id] = pose
            if self._is_complete():
                self._changed.notify()
        # With each pose: an urgent command discards the frame that is queued.
        self._broadcaster.put_latest(_STREAM, self._frame)

    def _is_complete(self):
        return len(self._waiting) >= self.vehicles

    def _frame(self):
        with self._changed:
            if self._waiting:
                self._changed.wait_for(self._is_complete, FRAME_WINDOW)
            waiting, self._waiting = self._waiting, {}
        return pack(waiting)


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
            raise ValueRangeError("external pose: the quaternion (0, 0, 0, 0) is not an attitude")
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


STATIONS = 16  #: Largest number of base stations of the firmware.

_TYPE = "lighthouse.systemType"
_STORE = bytes([CflibLocalization.LH_PERSIST_DATA])

_READ_LIMIT = 10.0  #: Time limit of reading all base stations of one kind of memory, s.
_ANGLE_LIMIT = 5.0  #: Time in which the vehicle must have measured angles often enough, s.
_FEWEST_ANGLES = 10  #: Least number of sets of angles from a visible base station.

_FLASH_LIMIT = 3.0  #: Time limit of storing (s): the vehicle may reorganise its flash memory.


class Lighthouse(Subsystem):
    """The base stations that the vehicle stores, and those that it sees."""

    def read(self) -> tuple[dict[int, LighthouseBsGeometry], dict[int, LighthouseBsCalibration]]:
        """Return the valid geometries and calibrations in the vehicle, by number; blocks."""
        link = self._current_link()
        find_memory(link, MemoryElement.TYPE_LH, "base stations")
        helper = LighthouseMemHelper(link.cflib)
        results: queue.SimpleQueue[dict[int, Any]] = queue.SimpleQueue()
        found = []
        for what, read in (
            ("geometries", helper.read_all_geos),
            ("calibrations", helper.read_all_calibs),
        ):
            read(results.put)
            try:
                pages = results.get(timeout=_READ_LIMIT)
            except queue.Empty:
                raise NoReplyError(
                    f"the {what} of base stations were not read in {_READ_LIMIT:g} s"
                ) from None
            found.append({number: page for number, page in pages.items() if page.valid})
        return found[0], found[1]

    def angles(self) -> dict[int, LighthouseBsVectors]:
        """Return the mean angles of all base stations that are seen, by number; blocks for 1 s.

        They are compensated by the calibration. Empty if no base station is seen.
        """
        results: queue.SimpleQueue[dict[int, Any]] = queue.SimpleQueue()
        reader = LighthouseSweepAngleAverageReader(self._current_link().cflib, results.put)
        reader.start_angle_collection()
        try:
            measured = results.get(timeout=_ANGLE_LIMIT)
        except queue.Empty:
            reader.stop_angle_collection()
            return {}
        return {
            number: vectors
            for number, (count, vectors) in sorted(measured.items())
            if count >= _FEWEST_ANGLES
        }

    def write_file(self, path: str, parameters: FirmwareParameters) -> int:
        """Write a configuration as cfclient writes it, and store it; blocks.

        The data of all other stations become invalid. Returns the number of stations in the file.
        Raises `ValueRangeError` about the file, before anything is written; `CrazyflieError` if the
        vehicle does not take it.
        """
        geometries, calibrations, system_type = _read_file(path)
        numbers = {*geometries, *calibrations}
        link = self._current_link()
        memory = find_memory(link, MemoryElement.TYPE_LH, "base stations").id
        room = _room(link, memory)
        if max(numbers) >= room:
            raise ValueRangeError(
                f"lighthouse file {path}: the firmware has room for {room} base stations, 0 to "
                f"{room - 1}, the file has number {max(numbers)}; nothing is written"
            )
        if parameters.values().get(_TYPE) != system_type:
            # cflib's reader forgets all stations.
            parameters.write(_TYPE, system_type)
        try:
            for given, none, first in (
                (geometries, LighthouseBsGeometry(), LighthouseMemory.GEO_START_ADDR),
                (calibrations, LighthouseBsCalibration(), LighthouseMemory.CALIB_START_ADDR),
            ):
                for number in range(room):
                    address, data = first + number * LighthouseMemory.PAGE_SIZE, bytearray()
                    given.get(number, none).add_mem_data(data)
                    write_memory(link, memory, address, bytes(data), f"base station {number}")
            self._store((1 << room) - 1)
        except CrazyflieError as error:
            raise type(error)(
                f"{error}; the vehicle may have a part of the file's base stations: write it "
                "again, or restart the vehicle, which then has those that it stored last"
            ) from None
        return len(numbers)

    def _store(self, mask):
        port, channel = CRTPPort.LOCALIZATION, CflibLocalization.GENERIC_CH
        what = "storing the base stations"
        request = Request(port, channel, _STORE, what, limit=_FLASH_LIMIT)
        answer = self._current_link().request(_STORE + struct.pack("<HH", mask, mask), request)
        if len(answer) < 2 or not answer[1]:
            raise RefusedError(f"{what}: the vehicle refuses it")


def _room(link, memory):
    """Return the number of base stations for which the firmware is built; blocks."""
    size = LighthouseMemory.PAGE_SIZE
    for number in range(STATIONS):
        if not has_memory(link, memory, number * size, f"base station {number}"):
            return number
    return STATIONS


def _read_file(path):
    """Return geometries and calibrations by number, and the system type; see `write_file`."""
    layout = LighthouseConfigFileManager
    try:
        content = yaml_file.load(path).value
        for key, expected in ((layout.TYPE_ID, layout.TYPE), (layout.VERSION_ID, layout.VERSION)):
            if str(content.get(key)) != expected:
                raise ValueError(f"{key} is {content.get(key)!r}; expected {expected}")
        geometries, calibrations = (
            {
                number: kind.from_file_object(each)
                for number, each in (content.get(key) or {}).items()
            }
            for key, kind in (
                (layout.GEOS_ID, LighthouseBsGeometry),
                (layout.CALIBS_ID, LighthouseBsCalibration),
            )
        )
        # Texts, and too few numbers, are found before anything is written.
        for each in (*geometries.values(), *calibrations.values()):
            each.add_mem_data(bytearray())
        for each in geometries.values():
            check_finite("geometry", *each.origin, *itertools.chain(*each.rotation_matrix))
        for sweep in itertools.chain(*(each.sweeps for each in calibrations.values())):
            check_finite("calibration", *vars(sweep).values())
        unknown = [n for n in (*geometries, *calibrations) if n not in range(STATIONS)]
    except ParameterError as error:
        raise ValueRangeError(f"lighthouse file {error}") from None
    except Exception as error:
        # cflib raises any error of an invalid file.
        raise ValueRangeError(
            f"lighthouse file {path}: {error!r}; expected a lighthouse_system_configuration, as "
            "cfclient and cflib write it"
        ) from None
    if not geometries:
        raise ValueRangeError(
            f"lighthouse file {path}: the geometry of no base station; expected at least one"
        )
    if unknown:
        raise ValueRangeError(
            f"lighthouse file {path}: base station {unknown[0]!r}; expected 0 to {STATIONS - 1}"
        )
    system_type = content.get(layout.SYSTEM_TYPE_ID, layout.SYSTEM_TYPE_V2)
    if system_type not in (layout.SYSTEM_TYPE_V1, layout.SYSTEM_TYPE_V2):
        raise ValueRangeError(
            f"lighthouse file {path}: {layout.SYSTEM_TYPE_ID} is {system_type!r}; expected "
            f"{layout.SYSTEM_TYPE_V1} or {layout.SYSTEM_TYPE_V2}"
        )
    return geometries, calibrations, system_type
