"""How far the set-up of a connection has come, as the packets that arrive show."""

import struct

_LOGGING, _MEMORY, _PARAMETERS = 5, 4, 2
_NAMES = {_LOGGING: "log table", _PARAMETERS: "parameter table"}

_TABLE_CHANNEL, _READ_CHANNEL, _MISC_CHANNEL = 0, 1, 3
_ITEM, _INFO = 2, 3


class SetupProgress:
    """The present step of a connection's set-up, in words."""

    def __init__(self) -> None:
        self._step = "waiting for the first answer"
        self._sizes: dict[int, int] = {}
        self._values: set[bytes] = set()

    def __str__(self) -> str:
        """Return the step, such as "log table, item 17 of 337"."""
        return self._step

    def receive(self, port: int, channel: int, data: bytes) -> bool:
        """Take note of a packet; return whether it advances the set-up."""
        if channel == _TABLE_CHANNEL and port in _NAMES and data:
            return self._receive_table(port, data)
        if port == _MEMORY:
            self._step = "list of memories"
            return True
        if port == _PARAMETERS and channel == _READ_CHANNEL:
            # A value that comes again is no progress.
            known = len(self._values)
            self._values.add(bytes(data[:2]))
            total = self._sizes.get(_PARAMETERS, 0)
            self._step = f"parameter values, {len(self._values)} of {total}"
            return len(self._values) > known
        if port == _PARAMETERS and channel == _MISC_CHANNEL:
            self._step = "parameter types"
            return True
        return False

    def _receive_table(self, port, data):
        name = _NAMES[port]
        if data[0] == _INFO and len(data) >= 3:
            (self._sizes[port],) = struct.unpack_from("<H", data, 1)
            step = f"{name} of {self._sizes[port]} items"
        elif data[0] == _ITEM and len(data) >= 3:
            (index,) = struct.unpack_from("<H", data, 1)
            step = f"{name}, item {index + 1} of {self._sizes.get(port, 0)}"
        else:
            return False
        is_new = step != self._step
        self._step = step
        return is_new
