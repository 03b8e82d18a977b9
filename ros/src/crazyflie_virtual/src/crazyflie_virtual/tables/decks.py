"""The decks of the vehicle: what their one-wire memories say, and which there are."""

import struct
import zlib
from typing import NamedTuple

_SIZE = 112  #: Of a one-wire memory, bytes.
_BITCRAZE = 0xBC  #: Vendor.
_FAMILY = 0x0D  #: First byte of the serial numbers of this kind of memory.

_HEADER_MARK, _NAME, _REVISION = 0xEB, 1, 2


class Deck(NamedTuple):
    """A deck."""

    name: str  #: Also of its parameter in the group ``deck``.
    product: int
    revision: str

    @property
    def serial(self) -> bytes:
        """Serial number of its memory, 8 bytes."""
        return bytes([_FAMILY, self.product, 0, 0, 0, 0, 0, 0])

    def one_wire(self) -> bytearray:
        """Return the content of its memory.

        Header: mark, pins, vendor, product; elements: version, size, and each as
        number, size, text; after both the low byte of their CRC-32.
        """
        header = struct.pack("<BIBB", _HEADER_MARK, 0, _BITCRAZE, self.product)
        texts = ((_NAME, self.name), (_REVISION, self.revision))
        elements = b"".join(bytes([n, len(text)]) + text.encode() for n, text in texts)
        elements = bytes([0, len(elements)]) + elements
        content = b"".join(part + bytes([zlib.crc32(part) & 0xFF]) for part in (header, elements))
        return bytearray(content.ljust(_SIZE, b"\xff"))


LED_RING = Deck("bcLedRing", 0x01, "D1")
MULTIRANGER = Deck("bcMultiranger", 0x0C, "D")
FLOW = Deck("bcFlow2", 0x0F, "C")
LIGHTHOUSE = Deck("bcLighthouse4", 0x10, "D")


def decks(has_positioning: bool, has_multiranger: bool) -> list[Deck]:
    """Return the decks of a vehicle."""
    return [
        LED_RING,
        *((FLOW, LIGHTHOUSE) if has_positioning else ()),
        *((MULTIRANGER,) if has_multiranger else ()),
    ]
