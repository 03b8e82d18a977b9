"""Port 4: memories."""

import errno
import struct
from collections.abc import Iterable

from crazyflie_virtual.firmware.assertion import FirmwareAssertionError
from crazyflie_virtual.firmware.console import Warn
from crazyflie_virtual.tables.memories import Memory

_INFO, _READ, _WRITE = 0, 1, 2
_COUNT, _DETAILS = 1, 2

_MOST = 24  #: Bytes read at once.


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
            self._warn("memory", f"MEM: {number} has no {count} bytes at {address:#x} to read")
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
