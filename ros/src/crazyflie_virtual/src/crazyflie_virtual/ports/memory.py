"""Port 4: memories."""

import errno
import struct
from collections.abc import Iterable

from crazyflie_virtual.firmware.assertion import FirmwareAssertionError
from crazyflie_virtual.link.crtp import Packet, Port
from crazyflie_virtual.tables.memories import Memory

_INFO, _READ, _WRITE = 0, 1, 2
_COUNT, _DETAILS = 1, 2

_MOST = 24
"""Bytes read or written at once."""


class MemoryPort:
    """Reads and writes memories.

    Parameters
    ----------
    memories : iterable of Memory
        In the order of their numbers.
    """

    port = Port.MEMORY

    def __init__(self, memories: Iterable[Memory]):
        self._memories = tuple(memories)

    def handle(self, packet: Packet) -> list[Packet]:
        """Return the answers to a packet."""
        handlers = {_INFO: self._info, _READ: self._read, _WRITE: self._write}
        handler = handlers.get(packet.channel)
        answer = handler(packet.data) if handler else None
        return [] if answer is None else [Packet(Port.MEMORY, packet.channel, answer)]

    def _info(self, data):
        if data[:1] == bytes([_COUNT]):
            return bytes([_COUNT, len(self._memories)])
        if data[:1] == bytes([_DETAILS]) and len(data) >= 2:
            if data[1] >= len(self._memories):
                return data[:2]
            memory = self._memories[data[1]]
            return data[:2] + struct.pack("<BI8x", memory.type, memory.size)
        return None

    def _read(self, data):
        if len(data) < 6:
            return None
        number, address, count = struct.unpack_from("<BIB", data)
        if count > _MOST:
            raise FirmwareAssertionError(f"a read of {count} bytes of memory, of {_MOST} at most")
        error = self._check(number, address, count)
        if error:
            return data[:5] + bytes([error])
        return data[:5] + b"\0" + self._memories[number].read(address, count)

    def _write(self, data):
        if len(data) < 5:
            return None
        number, address = struct.unpack_from("<BI", data)
        content = data[5:]
        error = self._check(number, address, len(content))
        if not error:
            self._memories[number].write(address, content)
        return data[:5] + bytes([error])

    def _check(self, number, address, count):
        if number >= len(self._memories):
            return errno.ENOENT
        if address + count > self._memories[number].size:
            return errno.EIO
        return 0
