"""Tables of contents: variables and parameters for clients, with names and C types."""

import math
import struct
import zlib
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple


class NumberType(NamedTuple):
    """A number's type."""

    name: str  #: As in C.
    format: str  #: As in the module struct, without byte order.
    #: log_code, parameter_code: On the wire, of log variables and parameters; -1 for none.
    log_code: int
    parameter_code: int

    @property
    def is_float(self) -> bool:
        """Whether it is a floating-point type."""
        return self.format in "fe"

    @property
    def size(self) -> int:
        """Bytes on the wire."""
        return struct.calcsize("<" + self.format)

    def pack(self, value: float) -> bytes:
        """Return the bytes of a value; whole numbers are limited to the type's range."""
        return struct.pack("<" + self.format, self.convert(value))

    def unpack(self, data: bytes) -> float:
        """Return the value of `size` bytes."""
        return struct.unpack("<" + self.format, data)[0]

    def convert(self, value: float) -> float:
        """Return the value as packed: limited, and an integer for integer types."""
        if self.is_float:
            largest = _LARGEST.get(self.format, math.inf)
            return value if math.isnan(value) else max(-largest, min(largest, value))
        bits = 8 * self.size
        low, high = (
            (0, 2**bits - 1) if self.format.isupper() else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        )
        return 0 if math.isnan(value) else int(max(low, min(high, value)))


_LARGEST = {"f": 3.4028234e38, "e": 65504.0}

U8 = NumberType("uint8_t", "B", 1, 0x8)
U16 = NumberType("uint16_t", "H", 2, 0x9)
U32 = NumberType("uint32_t", "I", 3, 0xA)
I8 = NumberType("int8_t", "b", 4, 0x0)
I16 = NumberType("int16_t", "h", 5, 0x1)
I32 = NumberType("int32_t", "i", 6, 0x2)
FLOAT = NumberType("float", "f", 7, 0x6)
FP16 = NumberType("FP16", "e", 8, -1)
U64 = NumberType("uint64_t", "Q", -1, 0xB)

_TYPES = (U8, U16, U32, I8, I16, I32, FLOAT, FP16, U64)
#: LOG_TYPES, PARAMETER_TYPES: Code on the wire -> type.
LOG_TYPES = {each.log_code: each for each in _TYPES if each is not U64}
PARAMETER_TYPES = {each.parameter_code: each for each in _TYPES if each is not FP16}


_ITEM, _INFO = 2, 3


class Table:
    """A numbered list of entries and the answers to questions about it.

    Entries are (group, name, code) in the order of their numbers. Group and name have together at
    most 24 characters: an item is one packet. The code is type and flags, a byte. ``limits`` is
    what follows number of entries and checksum in the table's description.
    """

    def __init__(self, entries: Sequence[tuple[str, str, int]], limits: bytes = b""):
        self._items = [
            bytes([code]) + f"{group}\0{name}\0".encode() for group, name, code in entries
        ]
        self._limits = limits
        #: Checksum of the table, by which clients cache tables.
        self.crc = zlib.crc32(b"".join(self._items))

    def answer(self, request: bytes) -> bytes | None:
        """Return the answer to a request on the table's channel.

        An item that does not exist is answered with the command alone; an
        unknown command with None.
        """
        if request[:1] == bytes([_INFO]):
            return struct.pack("<BHI", _INFO, len(self._items), self.crc) + self._limits
        if request[:1] == bytes([_ITEM]) and len(request) >= 3:
            (index,) = struct.unpack_from("<H", request, 1)
            return request[:3] + self._items[index] if index < len(self._items) else request[:1]
        return None


#: Names of the controllers of attitude and of rates -> their attributes.
ATTITUDE_PIDS = {axis: axis for axis in ("roll", "pitch", "yaw")}
RATE_PIDS = {axis: f"{axis}_rate" for axis in ATTITUDE_PIDS}


def pid_paths(
    owner: str, pids: Mapping[str, str], suffixes: Iterable[str], attributes: Iterable[str]
) -> dict[str, str]:
    """Return name -> path from the `Firmware` of attributes of PID controllers.

    ``owner`` is the path to the object that has the controllers. Prefixes of names lead to the
    owner's attributes (``pids``), suffixes to the controller's ``attributes``.
    """
    pairs = list(zip(suffixes, attributes, strict=True))
    return {
        prefix + suffix: f"{owner}.{pid}.{attribute}"
        for prefix, pid in pids.items()
        for suffix, attribute in pairs
    }
