"""Packets of the Crazy RealTime Protocol: datagrams, counts, and the console's text."""

from collections import deque
from collections.abc import Callable, Hashable
from enum import IntEnum
from typing import NamedTuple

MAX_DATA = 30  #: Bytes of a packet without its header.
_RESERVED = 3 << 2  #: Bits of the header that are set, except in broadcast packets.


class Port(IntEnum):
    """The receiver of a packet in the firmware."""

    CONSOLE = 0x0
    PARAMETERS = 0x2
    SETPOINT = 0x3
    MEMORY = 0x4
    LOG = 0x5
    LOCALIZATION = 0x6
    GENERIC_SETPOINT = 0x7
    HIGH_LEVEL = 0x8
    SUPERVISOR = 0x9
    PLATFORM = 0xD
    LINK = 0xF


class Packet(NamedTuple):
    """One packet."""

    #: port, channel: 0 to 15 and 0 to 3.
    port: int
    channel: int
    data: bytes  #: At most `MAX_DATA`.

    def encode(self) -> bytes:
        """Return the packet as a datagram; ValueError if the data are too long for one."""
        if len(self.data) > MAX_DATA:
            raise ValueError(f"a packet has at most {MAX_DATA} bytes, got {len(self.data)}")
        return bytes([self.port << 4 | _RESERVED | self.channel]) + self.data


def decode(datagram: bytes) -> Packet | None:
    """Return the packet in a datagram, or None."""
    if not 1 <= len(datagram) <= MAX_DATA + 1:
        return None
    return Packet(datagram[0] >> 4, datagram[0] & 3, datagram[1:])


def is_broadcast(datagram: bytes) -> bool:
    """Return whether a datagram is for all vehicles of a radio channel.

    Over UDP each gets a copy, in whose header the bits of the link are cleared.
    """
    is_for_link = datagram[0] >> 4 == Port.LINK if datagram else True
    return not is_for_link and not datagram[0] & _RESERVED


_ACTIVE = 2.0  #: Age of the last packet up to which the client is connected (s).


class LinkStatistics:
    """Traffic of the link, for the log."""

    def __init__(self) -> None:
        self.is_connected = False  #: Whether the last packet is younger than 2 s.
        #: Packets since the start, to this vehicle and to all, modulo 2^16.
        self.received = self.received_broadcasts = 0
        self.received_rate = self.sent_rate = 0.0  #: Packets per second, over the last second.
        self._last: float | None = None
        self._window = 0.0
        self._in = self._out = 0

    def count_received(self, time: float, is_broadcast: bool) -> None:
        """Count a packet that came at ``time`` (s)."""
        if is_broadcast:
            self.received_broadcasts = (self.received_broadcasts + 1) & 0xFFFF
        else:
            self.received = (self.received + 1) & 0xFFFF
        self._in += 1
        self._last = time
        self.is_connected = True

    def count_sent(self, packets: int) -> None:
        """Count packets to the client."""
        self._out += packets

    def update(self, time: float) -> None:
        """Update rates and connection to ``time`` (s)."""
        self.is_connected = self._last is not None and time - self._last < _ACTIVE
        elapsed = time - self._window
        if elapsed >= 1.0:
            self.received_rate, self.sent_rate = self._in / elapsed, self._out / elapsed
            self._in = self._out = 0
            self._window = time


class FirmwareAssertionError(Exception):
    """An assertion of the firmware has failed, on a packet that it does not handle.

    The text names the packet.
    """


Warn = Callable[[Hashable, str], bool]  #: See `Console.warn`.
_BUFFER_SIZE = 100  #: Packets kept until a client is connected: the latest.
_WARNING_PERIOD = 1.0  #: Shortest time between two warnings of one kind (s).


class Console:
    """Text that waits for transmission to the client; ``time()`` returns the time, s."""

    def __init__(self, time: Callable[[], float]) -> None:
        self._time = time
        self._packets: deque[bytes] = deque(maxlen=_BUFFER_SIZE)
        self._last_warning: dict[Hashable, float] = {}

    def write_line(self, line: str) -> None:
        """Print a line."""
        data = (line + "\n").encode("ascii", "replace")
        self._packets.extend(data[i : i + MAX_DATA] for i in range(0, len(data), MAX_DATA))

    def warn(self, kind: Hashable, text: str) -> bool:
        """Print a line; return False if one of its kind was printed within `_WARNING_PERIOD`."""
        now = self._time()
        if now - self._last_warning.get(kind, -_WARNING_PERIOD) < _WARNING_PERIOD:
            return False
        self._last_warning[kind] = now
        self.write_line(text)
        return True

    def take(self) -> list[bytes]:
        """Return the data of the packets that wait, and forget them."""
        packets = list(self._packets)
        self._packets.clear()
        return packets
