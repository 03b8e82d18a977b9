"""Tables of contents: variables and parameters for clients, with names and C types."""

import math
import struct
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class NumberType:
    """A number's type."""

    name: str  #: As in C.
    format: str  #: As in the module struct, without byte order.

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

U8 = NumberType("uint8_t", "B")
U16 = NumberType("uint16_t", "H")
U32 = NumberType("uint32_t", "I")
I8 = NumberType("int8_t", "b")
I16 = NumberType("int16_t", "h")
I32 = NumberType("int32_t", "i")
FLOAT = NumberType("float", "f")
FP16 = NumberType("FP16", "e")
U64 = NumberType("uint64_t", "Q")

#: Code of a log variable on the wire -> type.
LOG_TYPES = {1: U8, 2: U16, 3: U32, 4: I8, 5: I16, 6: I32, 7: FLOAT, 8: FP16}

#: Code of a parameter on the wire -> type.
PARAMETER_TYPES = {
    0x8: U8,
    0x9: U16,
    0xA: U32,
    0xB: U64,
    0x0: I8,
    0x1: I16,
    0x2: I32,
    0x6: FLOAT,
}

LOG_CODES = {number_type: code for code, number_type in LOG_TYPES.items()}
PARAMETER_CODES = {number_type: code for code, number_type in PARAMETER_TYPES.items()}


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
    owner: str, pids: Mapping[str, str], attributes: Mapping[str, str]
) -> Iterable[tuple[str, str]]:
    """Yield (name, path from the `Firmware`) of attributes of PID controllers.

    ``owner`` is the path to the object that has the controllers. Prefixes of names lead to the
    owner's attributes (``pids``), suffixes to the controller's (``attributes``).
    """
    for prefix, pid in pids.items():
        for suffix, attribute in attributes.items():
            yield prefix + suffix, f"{owner}.{pid}.{attribute}"
