"""Logs that a vehicle has written to its micro SD card.

The file has the byte 0xBC, version and number of kinds of events (uint16 each); of each kind its
number (uint16), name, number of variables (uint16) and these, as in "acc.x(f)", with letters as
those of Python's struct; names end with a zero. Then come the events: number of the kind, time
since the vehicle was switched on (version 1: uint32, ms; 2: uint64, us), values; at last the CRC-32
of all that. Integers are little-endian. Source: Bitcraze's documentation of the Micro SD card deck.
"""

import math
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from crazyflie_model.angles import quaternion_from_zyx, rpy_from_quaternion
from crazyflie_model.units import thrust_from_pwm
from crazyflie_reports.bag_file import BagError, Connection
from crazyflie_reports.bag_topics import ROLES, Role, Row, Topic

MAGIC = 0xBC
#: Longest log (s): an event further from the middle one has a damaged time, and is left out.
LONGEST = 86_400.0

_TIMES = {1: ("<HI", 1e-3), 2: ("<HQ", 1e-6)}  # By version: kind and time, and its unit, s.
_LETTERS = frozenset("?bBhHiIlLqQefd")
_END = 4  # Bytes of the CRC.

_UNKNOWN = [math.nan, math.nan, math.nan]

Values = Mapping[str, float]


def _attitude(v: Values) -> Row | None:
    """Return roll, pitch and yaw, rad, of the first variables that have them."""
    if quaternion := _numbers(v, *(f"stateEstimate.q{each}" for each in "xyzw")):
        return rpy_from_quaternion(*quaternion)
    for group in ("stateEstimate", "stabilizer"):
        if angles := _numbers(v, *(f"{group}.{each}" for each in ("roll", "pitch", "yaw"))):
            roll, pitch, yaw = map(math.radians, angles)
            # The firmware's are those of Rz(yaw) Ry(pitch) Rx(roll), with the pitch inverted.
            return rpy_from_quaternion(*quaternion_from_zyx(roll, -pitch, yaw))
    return None


def _numbers(v: Values, *names: str) -> list[float] | None:
    return [v[each] for each in names] if all(each in v for each in names) else None


def _xyz(v, group, prefix=""):
    return _numbers(v, *(f"{group}.{prefix}{each}" for each in "xyz"))


def _state(v: Values) -> Row | None:
    position, attitude = _xyz(v, "stateEstimate"), _attitude(v)
    if position is None and attitude is None:
        return None
    velocity = _xyz(v, "stateEstimate", "v") or _UNKNOWN
    return (*(position or _UNKNOWN), *velocity, math.nan if attitude is None else attitude[2])


def _pose(v: Values) -> Row | None:
    attitude = _attitude(v)
    return attitude and (*(_xyz(v, "stateEstimate") or _UNKNOWN), *attitude)


def _control(v: Values) -> Row | None:
    found = _numbers(
        v, "ctrltarget.roll", "ctrltarget.pitch", "ctrltarget.yaw", "stabilizer.thrust"
    )
    if found is None:
        return None
    roll, pitch, yaw_rate, thrust = found
    angles = math.radians(roll), -math.radians(pitch), math.radians(yaw_rate)
    return (*angles, thrust_from_pwm(thrust))


def _reference(v: Values) -> Row | None:
    position = _xyz(v, "ctrltarget")
    return position and (*position, *(_xyz(v, "ctrltarget", "v") or _UNKNOWN), math.nan)


#: The variables that are read, in words.
EXPECTED = (
    "stateEstimate.x, y, z; stateEstimate.qx, qy, qz, qw, or roll, pitch, yaw of stateEstimate or "
    "stabilizer; ctrltarget.roll, pitch, yaw with stabilizer.thrust; ctrltarget.x, y, z; or pm.vbat"
)

_ROWS: dict[str, Callable[[Values], Row | None]] = {
    "state": _state,
    "pose": _pose,
    "final_control": _control,
    "reference": _reference,
    "battery": lambda v: _numbers(v, "pm.vbat"),
}


@dataclass(frozen=True, eq=False)
class UsdConnection(Connection):
    """A role for which the events of a kind have the variables."""

    #: vehicle, role: Name of the vehicle, that of the file; role of the values.
    vehicle: str
    role: Role

    def entry(self) -> Topic:
        """Return the reader for rows of `UsdLogFile.messages`, which need no decoding."""
        return Topic(self.vehicle, self.role, lambda row: (0.0, 0, row))


@dataclass
class _Kind:
    values: struct.Struct
    names: list[str]
    connections: dict[str, UsdConnection]  # By role.


def is_usd_log(path: Path) -> bool:
    """Return whether a file begins like these logs."""
    with path.open("rb") as file:
        return file.read(1) == bytes([MAGIC])


class UsdLogFile:
    """A log, as `bag_file.BagFile` is a bag. `BagError`: the file's header cannot be read."""

    def __init__(self, path: Path):
        self._path = path
        self.connections: list[Connection] = []
        self.interruption = ""  #: Reason why reading has ended early, or fault of the file.
        self._data = path.read_bytes()
        self.size = len(self._data)
        self.done = 0  #: Number of bytes that have been read.
        try:
            self._version, count = struct.unpack_from("<HH", self._data, 1)
            if self._version not in _TIMES:
                raise BagError(f"{path} has version {self._version} of the format; expected 1 or 2")
            self._place = 5
            self._kinds = dict(self._kind() for _ in range(count))
        except (struct.error, ValueError) as error:
            raise BagError(f"{path}: the header of this log is damaged: {error}") from None
        if not self.connections:
            there = ", ".join(name for kind in self._kinds.values() for name in kind.names)
            raise BagError(
                f"{path} has no variables of a flight; expected {EXPECTED}. There are: {there}"
            )

    def messages(
        self, is_wanted: Callable[[Connection], bool]
    ) -> Iterator[tuple[Connection, float, Any]]:
        """Yield connection, time since the vehicle was switched on (s), and row of each event."""
        data, end = self._data, self.size - _END
        if self._place <= end and zlib.crc32(data[:end]) != struct.unpack_from("<I", data, end)[0]:
            self.interruption = f"{self._path}: its check sum is another one: it is damaged"
        wanted = {
            number: [(role, c) for role, c in kind.connections.items() if is_wanted(c)]
            for number, kind in self._kinds.items()
        }
        times = np.fromiter((time for _, _, time, _ in self._events()), float)
        middle = float(np.median(times)) if len(times) else 0.0
        for place, number, time, values in self._events():
            self.done = place
            if abs(time - middle) > LONGEST:
                continue
            known = dict(zip(self._kinds[number].names, map(float, values), strict=True))
            for role, connection in wanted[number]:
                yield connection, time, _ROWS[role](known)

    def _events(self):
        """Yield place of the end, number of the kind, time (s) and values of each event."""
        layout, unit = _TIMES[self._version]
        head, data, place = struct.Struct(layout), self._data, self._place
        while place < self.size - _END:
            try:
                number, time = head.unpack_from(data, place)
                kind = self._kinds[number]
                values = kind.values.unpack_from(data, place + head.size)
            except (struct.error, KeyError):
                self.interruption = (
                    f"{self._path} breaks off at {place / 1e6:.2f} of {self.size / 1e6:.2f} MB, as "
                    "when the battery was taken out: the rest is missing here"
                )
                return
            place += head.size + kind.values.size
            yield place, number, unit * time, values

    def _kind(self):
        number = self._integer()
        event = self._name()
        variables = [self._name() for _ in range(self._integer())]
        letters = [each[-2:-1] for each in variables if each[-3:-2] == "(" and each[-1:] == ")"]
        if len(letters) < len(variables) or not _LETTERS.issuperset(letters):
            raise ValueError(f"variables {', '.join(variables)}; expected each as in acc.x(f)")
        names = [each[:-3] for each in variables]
        sample = dict.fromkeys(names, 1.0)
        roles = {
            role.name: UsdConnection(f"{event}/{role.name}", "uSD log", "", self._path.name, role)
            for role in ROLES
            if role.name in _ROWS and _ROWS[role.name](sample) is not None
        }
        self.connections += roles.values()
        return number, _Kind(struct.Struct("<" + "".join(letters)), names, roles)

    def _integer(self):
        (number,) = struct.unpack_from("<H", self._data, self._place)
        self._place += 2
        return number

    def _name(self):
        end = self._data.index(0, self._place)
        text = self._data[self._place : end].decode("ascii")
        self._place = end + 1
        return text
