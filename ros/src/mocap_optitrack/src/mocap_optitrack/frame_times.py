"""Times of exposure or arrival of frames, for streams with and without time stamps."""

import math
from collections import deque
from enum import Enum
from statistics import median

_BUCKET = 0.25  #: Local time whose shortest delay is stored as one figure (s).

#: Buckets that make up the window: 5 s, in which clocks that differ by 50 ppm, a lot for quartz,
#: drift apart by 0.25 ms.
_BUCKETS = 20

#: Largest difference of the shortest delays of two consecutive buckets (s). A new stream is not
#: published before; on a bad network, until the window is full.
_AGREEMENT = 2e-3

#: Largest rate of change of the offset (s/s). A velocity from stamps is wrong by this fraction at
#: most, and stamps never run backwards; no quartz drifts as fast.
_SLEW = 1e-3

_JUMP = 0.1  #: Smallest difference that drift does not explain (s).

#: Longest time by which networks delay a message (s): one that was sent longer before the newest
#: one was not overtaken.
_RESTART = 1.0

#: Number of consecutive contradicting messages after which the clock was set.
_CONTRADICTION_LIMIT = 10


class FrameOrder(Enum):
    """What a message is among those before it, by its times."""

    NEW = "new"  #: It was sent after all others.
    OLD = "old"  #: It was sent with or before one that has come already: duplicated, or overtaken.
    FOREIGN = "foreign"  #: It was stamped by another clock: too old, or later than its arrival.
    #: One of the clocks was set; learning restarts with this message.
    RESTART = "restart"
    LEARNING = "learning"  #: It is new, but its time by the local clock is not known yet.
    STALE = "stale"  #: It is new, but too old to be used.


class ClockOffset:
    """Local time from that of a server, whose messages come with varying delay.

    A message that is sent at ``s`` and arrives at ``a`` shows ``a - s = offset +
    delay``. Delays are positive, most of them small and a few large, so that the
    smallest difference of the last five seconds is the offset but for the
    shortest delay, which on a wired network is a fraction of a millisecond. (A mean would follow
    every busy moment.) The estimate changes smoothly. Silence does not change it.

    A message that contradicts the others is dropped. Only when they keep coming has a
    clock been set, or the server been restarted, and learning restarts.
    """

    def __init__(self) -> None:
        self._reset()

    def _reset(self) -> None:
        # Begin and smallest difference of each bucket.
        self._window: deque[tuple[float, float]] = deque(maxlen=_BUCKETS)
        self._offset: float | None = None
        self._updated = 0.0
        self._newest = -math.inf
        self._contradictions = 0

    @property
    def is_settled(self) -> bool:
        """Whether enough messages have come to rely on `to_local`."""
        return self._offset is not None

    def update(self, sent: float, arrival: float) -> FrameOrder:
        """Process a message and return what it is.

        It was sent at a time of the server's clock, s, and arrived at one of the local clock, never
        before the last message.
        """
        difference = arrival - sent
        order = self._classify(sent, difference)
        if order is not FrameOrder.NEW:
            # Repetitions of the newest message do not show another clock.
            self._contradictions += sent != self._newest
            if self._contradictions < _CONTRADICTION_LIMIT:
                return order
        if order is not FrameOrder.NEW or self._has_lagged():
            order = FrameOrder.RESTART
            self._reset()
        self._contradictions = 0
        self._newest = sent
        self._collect(arrival, difference)
        shortest = self._shortest()
        if self._offset is not None:
            step = _SLEW * (arrival - self._updated)
            self._offset += min(max(shortest - self._offset, -step), step)
        elif self._is_plausible():
            self._offset = shortest
        self._updated = arrival
        return order

    def to_local(self, moment: float) -> float:
        """Return a moment of the server's clock (s) by the local clock (s).

        ValueError: not enough messages have come; see `is_settled`.
        """
        if self._offset is None:
            raise ValueError("the offset of the server's clock has not settled yet")
        return moment + self._offset

    def _shortest(self):
        return min((smallest for _, smallest in self._window), default=-math.inf)

    def _classify(self, sent, difference):
        if sent < self._newest - _RESTART or difference < self._shortest() - _JUMP:
            return FrameOrder.FOREIGN
        return FrameOrder.OLD if sent <= self._newest else FrameOrder.NEW

    def _has_lagged(self):
        # The server's clock was set back by a little, or has stood still.
        return self._offset is not None and self._shortest() > self._offset + _JUMP

    def _is_plausible(self):
        # The last bucket is still open, and its value preliminary.
        closed = [smallest for _, smallest in self._window][:-1]
        return len(closed) >= 2 and (
            abs(closed[-1] - closed[-2]) < _AGREEMENT or len(self._window) == _BUCKETS
        )

    def _collect(self, arrival, difference):
        if not self._window or arrival - self._window[-1][0] >= _BUCKET:
            self._window.append((arrival, difference))
        else:
            begin, smallest = self._window[-1]
            self._window[-1] = (begin, min(smallest, difference))


_INTERVALS = 50  #: Number of intervals whose median is the period of the stream.
_LEARNING = 10  #: Number of intervals that must be known before the median is used.
_STALL = 5.0  #: Number of periods without a frame after which the next one may have been waiting.


class ArrivalTimes:
    """Times of frames that come at a steady rate, from the moments at which they are read.

    A reader that was stopped or starved finds the missed frames in a buffer and reads them at once:
    each would seem to be new. The frames were sent one period apart, so that a frame that is read
    less than half a period after the last one had arrived before, one period after the last one. A
    frame for which the reader has waited arrived when it was read.

    After a stall it is unknown, until the second frame comes, whether the stream or the reader has
    paused: the first one has no time.
    """

    def __init__(self) -> None:
        self._intervals: deque[float] = deque(maxlen=_INTERVALS)
        self._last_read: float | None = None
        self._is_long = False
        self._time = 0.0

    def update(self, moment: float) -> float | None:
        """Return when a frame arrived that is read at ``moment`` (s of a monotonic clock).

        The result is at most ``moment``; None when it is unknown.
        """
        interval = None if self._last_read is None else moment - self._last_read
        self._last_read = moment
        if interval is None or len(self._intervals) < _LEARNING:
            self._time = moment
            if interval is not None:
                self._intervals.append(interval)
            return moment
        period = median(self._intervals)
        was_long, self._is_long = self._is_long, interval > _STALL * period
        if self._is_long:
            if was_long:
                # No backlog has followed: the stream has become slower.
                self._intervals.append(interval)
            self._time += period
            return None
        self._time = moment if interval > 0.5 * period else min(moment, self._time + period)
        if self._time == moment:
            # Frames from a buffer give no information about the rate.
            self._intervals.append(interval)
        return self._time
