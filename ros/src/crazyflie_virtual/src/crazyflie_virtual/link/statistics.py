"""Packets counted."""

_ACTIVE = 2.0  #: How long after the last packet the client counts as connected, s.


class LinkStatistics:
    """Traffic of the link, for the log."""

    def __init__(self) -> None:
        self.is_connected = False  #: Whether a packet came lately.
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
        """Let time pass, to ``time`` (s)."""
        self.is_connected = self._last is not None and time - self._last < _ACTIVE
        elapsed = time - self._window
        if elapsed >= 1.0:
            self.received_rate, self.sent_rate = self._in / elapsed, self._out / elapsed
            self._in = self._out = 0
            self._window = time
