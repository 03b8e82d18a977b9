"""The memories of vehicle and decks, and port 4, which reads and writes them."""

import errno
import struct
import zlib
from collections.abc import Iterable
from typing import NamedTuple

from typing_extensions import override

from crazyflie_virtual import settings
from crazyflie_virtual.crtp import FirmwareAssertionError, Warn

_SIZE = 112  #: Size of a one-wire memory (bytes).
_BITCRAZE = 0xBC  #: Vendor.
_FAMILY = 0x0D  #: First byte of the serial numbers of this kind of memory.

_HEADER_MARK, _NAME, _REVISION = 0xEB, 1, 2


EEPROM, ONE_WIRE, LED_RING, TRAJECTORY, LIGHTHOUSE = 0x00, 0x01, 0x10, 0x12, 0x14
TESTER, LED_TIMINGS, DECKS = 0x15, 0x17, 0x19  #: Types.

NO_SERIAL = bytes(8)

EEPROM_SERIAL = bytes(7) + b"\x50"  #: The I2C address, in place of a serial number.

_TESTER_SIZE = 4096
_EEPROM_SIZE = 8191

LED_RING_SIZE = 24  #: Twelve colours of 16 bits.
LED_TIMINGS_SIZE = 40  #: Ten steps of 4 bytes.


class Memory:
    """One memory with a serial number of 8 bytes; one of type bytes cannot be written.

    ``size`` is what clients see, bytes; that of the buffer by default.
    """

    def __init__(
        self,
        memory_type: int,
        buffer: bytes | bytearray,
        serial: bytes = NO_SERIAL,
        size: int | None = None,
    ):
        self.type = memory_type
        self.serial = serial
        self.size = len(buffer) if size is None else size
        self._buffer = buffer

    def read(self, address: int, count: int) -> bytes | None:
        """Return ``count`` bytes; None if an address does not exist."""
        end = address + count
        return bytes(self._buffer[address:end]) if end <= len(self._buffer) else None

    def write(self, address: int, data: bytes) -> bool:
        """Write data; return whether the addresses exist."""
        end = address + len(data)
        if isinstance(self._buffer, bytes) or end > len(self._buffer):
            return False
        self._buffer[address:end] = data
        return True


class MemoryTester(Memory):
    """A memory whose content is its addresses; written data are compared with them."""

    def __init__(self) -> None:
        super().__init__(TESTER, bytes(address & 0xFF for address in range(_TESTER_SIZE)))
        self.errors = 0  #: Number of wrong bytes.

    @property
    def reset_writes(self) -> int:
        """Always 0; setting it resets the errors."""
        return 0

    @reset_writes.setter
    def reset_writes(self, value):
        if value:
            self.errors = 0

    @override
    def write(self, address: int, data: bytes) -> bool:
        expected = self.read(address, len(data))
        if expected is None:
            return False
        self.errors += sum(a != b for a, b in zip(data, expected, strict=True))
        return True


class LighthouseMemory(Memory):
    """Geometry and calibration of base stations.

    The ``stored`` pages, by number, persist over a restart.
    """

    STATIONS = 4  #: Number of base stations in the firmware's default configuration.

    CALIBRATION_PAGE = 16  #: Number of the first calibration's page; geometries begin at 0.

    _PAGE_SIZE = 0x100
    _GEOMETRY_SIZE = 49
    _CALIBRATION_SIZE = 61

    def __init__(self, stored: dict[int, bytes]):
        size = self.CALIBRATION_PAGE * self._PAGE_SIZE + self.STATIONS * self._CALIBRATION_SIZE
        super().__init__(LIGHTHOUSE, b"", size=size)
        self._stored = stored
        sizes = ((0, self._GEOMETRY_SIZE), (self.CALIBRATION_PAGE, self._CALIBRATION_SIZE))
        self._pages = {
            first + i: Memory(LIGHTHOUSE, bytearray(stored.get(first + i, bytes(size))))
            for first, size in sizes
            for i in range(self.STATIONS)
        }

    def store(self, geometries: int, calibrations: int) -> bool:
        """Store the pages that two bit masks select; return whether all exist."""
        masks = ((0, geometries), (self.CALIBRATION_PAGE, calibrations))
        marked = [first + i for first, mask in masks for i in range(16) if mask >> i & 1]
        pages = {number: self._pages[number] for number in marked if number in self._pages}
        for number in pages:
            self._stored[number] = self.page(number)
        return len(pages) == len(marked)

    def page(self, number: int) -> bytes:
        """Return a geometry or a calibration, whose last byte tells whether it is valid."""
        page = self._pages[number]
        return page.read(0, page.size) or b""

    @override
    def read(self, address: int, count: int) -> bytes | None:
        page, start = divmod(address, self._PAGE_SIZE)
        return self._pages.get(page, _NO_PAGE).read(start, count)

    @override
    def write(self, address: int, data: bytes) -> bool:
        page, start = divmod(address, self._PAGE_SIZE)
        return self._pages.get(page, _NO_PAGE).write(start, data)


_NO_PAGE = Memory(LIGHTHOUSE, b"")


class Deck(NamedTuple):
    """A deck."""

    name: str  #: Name of the deck, and of its parameter in the group ``deck``.
    product: int
    revision: str

    def memory(self) -> Memory:
        """Return its memory, as it leaves the factory.

        Header: mark, pins, vendor, product; elements: version, size, and each as
        number, size, text; after both the low byte of their CRC-32.
        """
        header = struct.pack("<BIBB", _HEADER_MARK, 0, _BITCRAZE, self.product)
        texts = ((_NAME, self.name), (_REVISION, self.revision))
        elements = b"".join(bytes([n, len(text)]) + text.encode() for n, text in texts)
        elements = bytes([0, len(elements)]) + elements
        content = b"".join(part + bytes([zlib.crc32(part) & 0xFF]) for part in (header, elements))
        serial = bytes([_FAMILY, self.product, 0, 0, 0, 0, 0, 0])
        return Memory(ONE_WIRE, bytearray(content.ljust(_SIZE, b"\xff")), serial)


LED_RING_DECK = Deck("bcLedRing", 0x01, "D1")
MULTIRANGER_DECK = Deck("bcMultiranger", 0x0C, "D")
FLOW_DECK = Deck("bcFlow2", 0x0F, "C")
LIGHTHOUSE_DECK = Deck("bcLighthouse4", 0x10, "D")
LOCO_DECK = Deck("bcDWM1000", 0x06, "B")

_POSITIONING_DECKS = {
    settings.DECK: (FLOW_DECK, LIGHTHOUSE_DECK),
    settings.FLOW: (FLOW_DECK,),
    settings.LIGHTHOUSE: (LIGHTHOUSE_DECK,),
    settings.LOCO: (LOCO_DECK,),
}


def decks(positioning: str, has_multiranger: bool) -> list[Deck]:
    """Return the decks of a vehicle with a positioning system of its settings."""
    return [
        LED_RING_DECK,
        *_POSITIONING_DECKS.get(positioning, ()),
        *((MULTIRANGER_DECK,) if has_multiranger else ()),
    ]


def decks_firmware() -> Memory:
    """Return the memory that describes the decks' own firmware, which none of them has."""
    places, version, info_size = 4, 3, 0x20
    info = bytes([version]) + bytes(2 * places * info_size)
    return Memory(DECKS, info, size=0x10000000 * (places + 1))


def eeprom(radio_address: int) -> Memory:
    """Return the configuration memory as it leaves the factory.

    Token, version 1, radio channel 80, 2 Mbit/s, pitch and roll trim, address of
    the radio (high byte, low word), sum of all bytes.
    """
    content = b"0xBC" + struct.pack(
        "<BBBffBI", 1, 80, 2, 0.0, 0.0, radio_address >> 32, radio_address & 0xFFFFFFFF
    )
    content += bytes([sum(content) & 0xFF])
    return Memory(EEPROM, bytearray(content.ljust(_EEPROM_SIZE, b"\0")), EEPROM_SERIAL)


_INFO, _READ, _WRITE = 0, 1, 2
_COUNT, _DETAILS = 1, 2

_MOST = 24  #: Largest number of bytes of a read.


class MemoryPort:
    """Reads and writes memories, in the order of their numbers; for ``warn`` see `Console.warn`."""

    def __init__(self, memories: Iterable[Memory], warn: Warn):
        self._memories = tuple(memories)
        self._warn = warn

    def handle(self, channel: int, data: bytes) -> bytes | None:
        """Return the data of the answer; None for no answer."""
        handlers = {_INFO: self._info, _READ: self._read, _WRITE: self._write}
        return handlers.get(channel, self._unknown)(data)

    def _info(self, data):
        if data[:1] == bytes([_COUNT]):
            return bytes([_COUNT, len(self._memories)])
        if data[:1] == bytes([_DETAILS]) and len(data) >= 2:
            if data[1] >= len(self._memories):
                return data[:2]
            memory = self._memories[data[1]]
            return data[:2] + struct.pack("<BI8s", memory.type, memory.size, memory.serial)
        return self._unknown(data)

    def _unknown(self, data):
        self._warn("memory", f"MEM: unknown request {data[:1].hex()}")
        return None

    def _read(self, data):
        if len(data) < 6:
            return None
        number, address, count = struct.unpack_from("<BIB", data)
        if count > _MOST:
            raise FirmwareAssertionError(f"a read of {count} bytes of memory, of {_MOST} at most")
        content = None
        if number < len(self._memories):
            content = self._memories[number].read(address, count)
        if content is None:
            self._warn(
                "memory", f"MEM: memory {number} does not have {count} bytes at {address:#x}"
            )
            return data[:5] + bytes([errno.EIO])
        return data[:5] + b"\0" + content

    def _write(self, data):
        if len(data) < 5:
            return None
        number, address = struct.unpack_from("<BI", data)
        content = data[5:]
        done = number < len(self._memories) and self._memories[number].write(address, content)
        if not done:
            text = f"MEM: {number} has no {len(content)} bytes at {address:#x} to write"
            self._warn("memory", text)
        return data[:5] + bytes([0 if done else errno.EIO])
