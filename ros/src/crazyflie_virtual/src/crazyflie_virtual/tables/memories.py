"""The memories of the vehicle that a client can read and write."""

import struct
from collections.abc import Callable
from dataclasses import dataclass

EEPROM, TRAJECTORY, TESTER = 0x00, 0x12, 0x15
"""Types."""

_TESTER_SIZE = 4096
_EEPROM_SIZE = 112


@dataclass(frozen=True)
class Memory:
    """One memory.

    Attributes
    ----------
    type : int
    size : int
        Bytes.
    read : callable
        ``read(address, count)`` returns bytes.
    write : callable
        ``write(address, data)``.
    """

    type: int
    size: int
    read: Callable[[int, int], bytes]
    write: Callable[[int, bytes], None]

    @classmethod
    def over(cls, memory_type: int, buffer: bytearray) -> "Memory":
        """Return the memory of a type that is a buffer."""

        def write(address, data):
            buffer[address : address + len(data)] = data

        def read(address, count):
            return bytes(buffer[address : address + count])

        return cls(memory_type, len(buffer), read, write)


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
        return bytes(a & 0xFF for a in range(address, address + count))

    def _write(self, address, data):
        expected = self._read(address, len(data))
        self.errors += sum(a != b for a, b in zip(data, expected, strict=True))


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
