"""The memories of vehicle and decks, and port 4, which reads and writes them."""

import errno
import struct
import zlib
from collections.abc import Iterable

from typing_extensions import override

from crazyflie_virtual import settings
from crazyflie_virtual.crtp import FirmwareAssertionError, Warn

EEPROM, ONE_WIRE, LED_RING, TRAJECTORY, LIGHTHOUSE = 0x00, 0x01, 0x10, 0x12, 0x14
TESTER, LED_TIMINGS, DECKS = 0x15, 0x17, 0x19  #: Types.

LED_RING_SIZE = 24  #: Twelve colours of 16 bits.
LED_TIMINGS_SIZE = 40  #: Ten steps of 4 bytes.
_TESTER_SIZE, _EEPROM_SIZE, _ONE_WIRE_SIZE = 4096, 8191, 112

_EEPROM_SERIAL = bytes(7) + b"\x50"  #: The I2C address, in place of a serial number.


class Memory:
    """One memory with a serial number of 8 bytes; one of type bytes cannot be written.

    ``size`` is what clients see, bytes; that of the buffer by default.
    """

    def __init__(
        self,
        memory_type: int,
        buffer: bytes | bytearray,
        serial: bytes = bytes(8),
        size: int | None = None,
    ):
        self.type = memory_type
        self.serial = serial
        self.size = len(buffer) if size is None else size
        self._buffer = buffer

    def read(self, address: int, count: int) -> bytes | None:
        """Return ``count`` bytes; None if an address does not exist."""
        buffer, start = self._place(address)
        end = start + count
        return bytes(buffer[start:end]) if end <= len(buffer) else None

    def write(self, address: int, data: bytes) -> bool:
        """Write data; return whether the addresses exist."""
        buffer, start = self._place(address)
        end = start + len(data)
        if isinstance(buffer, bytes) or end > len(buffer):
            return False
        buffer[start:end] = data
        return True

    def _place(self, address: int) -> tuple[bytes | bytearray, int]:
        # Buffer, and index in it, of an address.
        return self._buffer, address


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

    The ``stored`` pages, by number, persist over a restart. There is room for a number of
    ``stations``.
    """

    STATIONS = 4  #: Number of base stations in the firmware's default configuration.

    CALIBRATION_PAGE = 16  #: Number of the first calibration's page; geometries begin at 0.

    _PAGE_SIZE = 0x100
    _GEOMETRY_SIZE = 49
    _CALIBRATION_SIZE = 61

    def __init__(self, stored: dict[int, bytes], stations: int = STATIONS):
        self.stations = stations
        size = self.CALIBRATION_PAGE * self._PAGE_SIZE + stations * self._CALIBRATION_SIZE
        super().__init__(LIGHTHOUSE, b"", size=size)
        self._stored = stored
        sizes = ((0, self._GEOMETRY_SIZE), (self.CALIBRATION_PAGE, self._CALIBRATION_SIZE))
        self._pages = {
            first + i: bytearray(stored.get(first + i, bytes(size)))
            for first, size in sizes
            for i in range(stations)
        }

    def store(self, geometries: int, calibrations: int) -> bool:
        """Store the pages that two bit masks select; return whether all exist."""
        marked = geometries | calibrations << self.CALIBRATION_PAGE
        numbers = {number for number in range(marked.bit_length()) if marked >> number & 1}
        self._stored |= {number: self.page(number) for number in numbers & self._pages.keys()}
        return numbers <= self._pages.keys()

    def page(self, number: int) -> bytes:
        """Return a geometry or a calibration, whose last byte tells whether it is valid."""
        return bytes(self._pages[number])

    @override
    def _place(self, address: int) -> tuple[bytes | bytearray, int]:
        page, start = divmod(address, self._PAGE_SIZE)
        return self._pages.get(page, b""), start


#: Positioning system -> its decks: name, product and revision.
_POSITIONING_DECKS = {
    settings.DECK: (("bcFlow2", 0x0F, "C"), ("bcLighthouse4", 0x10, "D")),
    settings.FLOW: (("bcFlow2", 0x0F, "C"),),
    settings.LIGHTHOUSE: (("bcLighthouse4", 0x10, "D"),),
    settings.LOCO: (("bcDWM1000", 0x06, "B"),),
}


_COLOR_LEDS = (("bcColorLedBot", 0x13, "A"), ("bcColorLedTop", 0x14, "A"))


def one_wire(vehicle: settings.VehicleSettings) -> list[Memory]:
    """Return the memories of the decks of a vehicle."""
    lights = _COLOR_LEDS if vehicle.color_leds else (("bcLedRing", 0x01, "D1"),)
    multiranger = (("bcMultiranger", 0x0C, "D"),) if vehicle.multiranger else ()
    decks = (*lights, *_POSITIONING_DECKS.get(vehicle.positioning, ()), *multiranger)
    return [_one_wire(*deck) for deck in decks]


def _one_wire(name: str, product: int, revision: str) -> Memory:
    # As it leaves the factory. Header: mark, pins, vendor (Bitcraze), product; elements: version,
    # size, and each as number, size, text; after both the low byte of their CRC-32.
    header = struct.pack("<BIBB", 0xEB, 0, 0xBC, product)
    elements = b"".join(
        bytes([number, len(text)]) + text.encode() for number, text in ((1, name), (2, revision))
    )
    elements = bytes([0, len(elements)]) + elements
    content = b"".join(part + bytes([zlib.crc32(part) & 0xFF]) for part in (header, elements))
    # The first byte is that of all memories of this kind.
    serial = bytes([0x0D, product, 0, 0, 0, 0, 0, 0])
    return Memory(ONE_WIRE, bytearray(content.ljust(_ONE_WIRE_SIZE, b"\xff")), serial)


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
    return Memory(EEPROM, bytearray(content.ljust(_EEPROM_SIZE, b"\0")), _EEPROM_SERIAL)


_INFO, _READ, _WRITE = 0, 1, 2
_COUNT, _DETAILS = 1, 2

_MOST = 24  #: Largest number of bytes of a read.


class MemoryPort:
    """Reads and writes memories, in the order of their numbers; for ``warn`` see `Console.warn`."""

    def __init__(self, memories: Iterable[Memory], warn: Warn):
        self._memories = dict(enumerate(memories))
        self._warn = warn

    def handle(self, channel: int, data: bytes) -> bytes | None:
        """Return the data of the answer; None for no answer."""
        if channel == _READ:
            return self._read(data) if len(data) >= 6 else None
        if channel == _WRITE:
            return self._write(data) if len(data) >= 5 else None
        if channel == _INFO and data[:1] == bytes([_COUNT]):
            return bytes([_COUNT, len(self._memories)])
        if channel == _INFO and data[:1] == bytes([_DETAILS]) and len(data) >= 2:
            memory = self._memories.get(data[1])
            if memory is None:
                return data[:2]
            return data[:2] + struct.pack("<BI8s", memory.type, memory.size, memory.serial)
        self._warn("memory", f"MEM: unknown request {data[:1].hex()}")
        return None

    def _read(self, data):
        number, address, count = struct.unpack_from("<BIB", data)
        if count > _MOST:
            raise FirmwareAssertionError(f"a read of {count} bytes of memory, of {_MOST} at most")
        memory = self._memories.get(number)
        content = None if memory is None else memory.read(address, count)
        if content is None:
            text = f"MEM: memory {number} does not have {count} bytes at {address:#x}"
            self._warn("memory", text)
            return data[:5] + bytes([errno.EIO])
        return data[:5] + b"\0" + content

    def _write(self, data):
        (number, address), content = struct.unpack_from("<BI", data), data[5:]
        memory = self._memories.get(number)
        done = memory is not None and memory.write(address, content)
        if not done:
            text = f"MEM: {number} has no {len(content)} bytes at {address:#x} to write"
            self._warn("memory", text)
        return data[:5] + bytes([0 if done else errno.EIO])
