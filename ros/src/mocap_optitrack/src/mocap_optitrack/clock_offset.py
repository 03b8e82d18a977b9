"""The server's clock by the local one."""

from collections import deque

_BUCKET = 0.25
"""s of local time whose shortest delay is kept as one figure."""

_BUCKETS = 20
"""Buckets that make up the window: 5 s, in which clocks that differ by 50 ppm, a lot
for quartz, drift apart by 0.25 ms."""

_AGREEMENT = 2e-3
"""A new stream is only listened to until the shortest delays of two buckets in a row
differ by less than this, s; or, on a bad network, until the window is full."""

_SLEW = 1e-3
"""How fast the offset follows, s/s. A velocity from stamps is wrong by this fraction at
most, and stamps never run backwards; no quartz drifts as fast."""

_JUMP = 0.1
"""A difference that no drift explains, s: one of the clocks was set."""


class ClockOffset:
    """Local time from that of a server, whose messages come with varying delay.

    A message that is sent at ``s`` and arrives at ``a`` shows ``a - s = offset +
    delay``. Delays are positive, most of them small and a few large, so that the
    smallest difference of the last five seconds is the offset but for the
    shortest delay, which on a wired network is a fraction of a millisecond. (A
    mean would follow every busy moment.) What has been learned is applied
    smoothly. When a clock is set or the server starts again, learning begins anew.
    """

    _offset: float | None
    _sent: float | None
    _updated: float

    def __init__(self) -> None:
        self._forget()

    @property
    def is_settled(self) -> bool:
        """Whether enough messages have come to rely on `to_local`."""
        return self._offset is not None

    def update(self, sent: float, arrival: float) -> bool:
        """Take note of a message; return False if a clock was set since the last one.

        Parameters
        ----------
        sent : float
            s of the server's clock.
        arrival : float
            s of the local clock; never before that of the last message.
        """
        difference = arrival - sent
        is_consistent = not self._is_contradiction(sent, difference)
        if not is_consistent:
            self._forget()
        self._sent = sent
        self._collect(arrival, difference)
        shortest = min(smallest for _, smallest in self._window)
        if self._offset is not None:
            step = _SLEW * (arrival - self._updated)
            self._offset += min(max(shortest - self._offset, -step), step)
        elif self._is_plausible():
            self._offset = shortest
        self._updated = arrival
        return is_consistent

    def to_local(self, moment: float) -> float:
        """Return a moment of the server's clock (s) by the local clock (s).

        Raises
        ------
        ValueError
            Not enough messages have come; see `is_settled`.
        """
        if self._offset is None:
            raise ValueError("the offset of the server's clock has not settled yet")
        return moment + self._offset

    def _forget(self):
        # Of each bucket: when it began, and its smallest difference.
        self._window: deque[tuple[float, float]] = deque(maxlen=_BUCKETS)
        self._offset = None
        self._updated = 0.0
        self._sent = None

    def _is_contradiction(self, sent, difference):
        if self._sent is not None and sent < self._sent:
            return True
        if self._offset is None:
            return False
        shortest = min(smallest for _, smallest in self._window)
        return difference < shortest - _JUMP or shortest > self._offset + _JUMP

    def _is_plausible(self):
        # The last bucket is still open: it is not yet what it will be.
        *closed, _ = self._window
        if len(closed) < 2:
            return False
        (_, before), (_, last) = closed[-2:]
        return abs(last - before) < _AGREEMENT or len(self._window) == _BUCKETS

    def _collect(self, arrival, difference):
        if not self._window or arrival - self._window[-1][0] >= _BUCKET:
            self._window.append((arrival, difference))
        else:
            begin, smallest = self._window[-1]
            self._window[-1] = (begin, min(smallest, difference))
