"""The C types of log variables and parameters: their codes and bytes on the wire."""

import math
import struct
from dataclasses import dataclass


@dataclass(frozen=True)
class NumberType:
    """A number's type.

    Attributes
    ----------
    name : str
        As in C.
    format : str
        As in the module struct, without byte order.
    log_code, parameter_code : int or None
        Code in the table of log variables and of parameters; None where the
        firmware has none.
    """

    name: str
    format: str
    log_code: int | None
    parameter_code: int | None

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
        """Return the value that is packed: limited, and whole where the type is whole."""
        if self.format in "fde":
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
FP16 = NumberType("FP16", "e", 8, None)
U64 = NumberType("uint64_t", "Q", None, 0xB)

LOG_TYPES = {t.log_code: t for t in (U8, U16, U32, I8, I16, I32, FLOAT, FP16)}
"""Code on the wire -> type."""

PARAMETER_TYPES = {t.parameter_code: t for t in (U8, U16, U32, U64, I8, I16, I32, FLOAT)}
"""Code on the wire -> type."""
