"""The console: what the firmware prints, warnings without effect, and failed assertions."""

from collections import deque
from collections.abc import Callable, Hashable

from crazyflie_virtual.crtp import MAX_DATA


class FirmwareAssertionError(Exception):
    """An assertion of the firmware has failed, on a packet that it takes no care of.

    The text says on what.
    """


Warn = Callable[[Hashable, str], bool]  #: See `Console.warn`.
_BUFFER_SIZE = 100  #: Packets kept until a client is connected: the latest.
_WARNING_PERIOD = 1.0  #: Between two warnings of one kind, s.


class Console:
    """Text on its way to the client; ``time()`` returns the time, s."""

    def __init__(self, time: Callable[[], float]) -> None:
        self._time = time
        self._packets: deque[bytes] = deque(maxlen=_BUFFER_SIZE)
        self._last_warning: dict[Hashable, float] = {}

    def write_line(self, line: str) -> None:
        """Print a line."""
        data = (line + "\n").encode("ascii", "replace")
        self._packets.extend(data[i : i + MAX_DATA] for i in range(0, len(data), MAX_DATA))

    def warn(self, kind: Hashable, text: str) -> bool:
        """Print a line; return False if there was one of its kind within `_WARNING_PERIOD`."""
        now = self._time()
        if now - self._last_warning.get(kind, -_WARNING_PERIOD) < _WARNING_PERIOD:
            return False
        self._last_warning[kind] = now
        self.write_line(text)
        return True

    def pop(self) -> bytes | None:
        """Return the data of the next packet; None when there is none."""
        return self._packets.popleft() if self._packets else None
