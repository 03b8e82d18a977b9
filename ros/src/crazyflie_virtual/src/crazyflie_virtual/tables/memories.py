"""The memories of the vehicle that a client can read and write."""

import struct
from collections.abc import Callable, Iterable
from dataclasses import dataclass

EEPROM, ONE_WIRE, LED_RING, TRAJECTORY, LIGHTHOUSE = 0x00, 0x01, 0x10, 0x12, 0x14
TESTER, LED_TIMINGS, DECKS = 0x15, 0x17, 0x19
"""Types."""

NO_SERIAL = bytes(8)

EEPROM_SERIAL = bytes(7) + b"\x50"
"""Its I2C address takes the place of a serial number."""

_TESTER_SIZE = 4096
_EEPROM_SIZE = 8191

LED_RING_SIZE = 24
"""Twelve colours of 16 bits."""

LED_TIMINGS_SIZE = 40
"""Ten steps of 4 bytes."""


@dataclass(frozen=True)
class Memory:
    """One memory.

    Attributes
    ----------
    type : int
    size : int
        Bytes.
    read : callable
        ``read(address, count)`` returns bytes; None where there is no such address.
    write : callable
        ``write(address, data)`` returns whether there is such an address.
    serial : bytes
        8 bytes.
    """

    type: int
    size: int
    read: Callable[[int, int], bytes | None]
    write: Callable[[int, bytes], bool]
    serial: bytes = NO_SERIAL

    @classmethod
    def over(cls, memory_type: int, buffer: bytearray, serial: bytes = NO_SERIAL) -> "Memory":
        """Return the memory of a type that is a buffer."""

        def write(address, data):
            return write_into(buffer, address, data)

        def read(address, count):
            return read_from(buffer, address, count)

        return cls(memory_type, len(buffer), read, write, serial)


def read_from(buffer: bytes | bytearray, address: int, count: int) -> bytes | None:
    """Return ``count`` bytes of a buffer; None where it has none."""
    end = address + count
    return bytes(buffer[address:end]) if end <= len(buffer) else None


def write_into(buffer: bytearray, address: int, data: bytes) -> bool:
    """Write into a buffer; return whether it goes so far."""
    end = address + len(data)
    if end > len(buffer):
        return False
    buffer[address:end] = data
    return True


class MemoryTester:
    """A memory that holds its addresses: reading gives them, writing is compared with them.

    Attributes
    ----------
    errors : int
        Bytes that were not as they should have been.
    """

    def __init__(self) -> None:
        self.errors = 0

    @property
    def reset_writes(self) -> int:
        """Always 0; setting it forgets the errors."""
        return 0

    @reset_writes.setter
    def reset_writes(self, value):
        if value:
            self.errors = 0

    def memory(self) -> Memory:
        """Return the memory."""
        return Memory(TESTER, _TESTER_SIZE, self._read, self._write)

    def _read(self, address, count):
        if address + count > _TESTER_SIZE:
            return None
        return bytes(a & 0xFF for a in range(address, address + count))

    def _write(self, address, data):
        expected = self._read(address, len(data))
        if expected is None:
            return False
        self.errors += sum(a != b for a, b in zip(data, expected, strict=True))
        return True


class LighthouseMemory:
    """Geometry and calibration of base stations; kept, but nothing is located with them.

    Parameters
    ----------
    stored : dict
        Page -> content, which outlives a restart.
    """

    STATIONS = 4
    """As many as the firmware is built for unless it is configured otherwise."""

    _CALIBRATION_PAGE = 16
    _PAGE_SIZE = 0x100
    _GEOMETRY_SIZE = 49
    _CALIBRATION_SIZE = 61

    def __init__(self, stored: dict[int, bytes]):
        self._stored = stored
        sizes = ((0, self._GEOMETRY_SIZE), (self._CALIBRATION_PAGE, self._CALIBRATION_SIZE))
        self._pages = {
            first + i: bytearray(stored.get(first + i, bytes(size)))
            for first, size in sizes
            for i in range(self.STATIONS)
        }

    def memory(self) -> Memory:
        """Return the memory."""
        size = self._CALIBRATION_PAGE * self._PAGE_SIZE + self.STATIONS * self._CALIBRATION_SIZE
        return Memory(LIGHTHOUSE, size, self._read, self._write)

    def store(self, geometries: int, calibrations: int) -> bool:
        """Keep what is marked in two bit masks over a restart; return whether all was there."""
        masks = ((0, geometries), (self._CALIBRATION_PAGE, calibrations))
        pages = [first + i for first, mask in masks for i in range(16) if mask >> i & 1]
        for page in pages:
            if page in self._pages:
                self._stored[page] = bytes(self._pages[page])
        return all(page in self._pages for page in pages)

    def _read(self, address, count):
        page, start = divmod(address, self._PAGE_SIZE)
        return read_from(self._pages.get(page, b""), start, count)

    def _write(self, address, data):
        page, start = divmod(address, self._PAGE_SIZE)
        return page in self._pages and write_into(self._pages[page], start, data)


def deck_memory() -> Memory:
    """Return the memory that describes the decks' own firmware: none of them has any."""
    places, version, info_size = 4, 3, 0x20
    info = bytes([version]) + bytes(2 * places * info_size)
    size = 0x10000000 * (places + 1)
    return Memory(
        DECKS, size, lambda address, count: read_from(info, address, count), lambda *_: False
    )


def memories(
    eeprom: bytearray,
    trajectories: bytearray,
    tester: MemoryTester,
    lighthouse: LighthouseMemory,
    one_wire: Iterable[tuple[bytes, bytearray]],
) -> list[Memory]:
    """Return all memories in the order of their numbers.

    Parameters
    ----------
    eeprom, trajectories : bytearray
    tester : MemoryTester
    lighthouse : LighthouseMemory
    one_wire : iterable of (bytes, bytearray)
        Serial number and content of the decks' memories.
    """
    return [
        Memory.over(EEPROM, eeprom, EEPROM_SERIAL),
        Memory.over(TRAJECTORY, trajectories),
        tester.memory(),
        Memory.over(LED_RING, bytearray(LED_RING_SIZE)),
        Memory.over(LED_TIMINGS, bytearray(LED_TIMINGS_SIZE)),
        lighthouse.memory(),
        deck_memory(),
        *(Memory.over(ONE_WIRE, content, serial) for serial, content in one_wire),
    ]


def eeprom(radio_address: int) -> bytearray:
    """Return the configuration memory as it leaves the factory.

    Token, version 1, radio channel 80, 2 Mbit/s, pitch and roll trim, address of
    the radio (high byte, low word), sum of all bytes.
    """
    content = b"0xBC" + struct.pack(
        "<BBBffBI", 1, 80, 2, 0.0, 0.0, radio_address >> 32, radio_address & 0xFFFFFFFF
    )
    content += bytes([sum(content) & 0xFF])
    return bytearray(content.ljust(_EEPROM_SIZE, b"\0"))
