"""Times of exposure or arrival of frames, for streams with and without time stamps."""

from collections import deque
from enum import Enum
from statistics import median

_BUCKET = 0.25  #: s of local time whose shortest delay is kept as one figure.

#: Buckets that make up the window: 5 s, in which clocks that differ by 50 ppm, a lot for quartz,
#: drift apart by 0.25 ms.
_BUCKETS = 20

#: A new stream is only listened to until the shortest delays of two buckets in a row differ by less
#: than this, s; or, on a bad network, until the window is full.
_AGREEMENT = 2e-3

#: Largest rate of change of the offset (s/s). A velocity from stamps is wrong by this fraction at
#: most, and stamps never run backwards; no quartz drifts as fast.
_SLEW = 1e-3

_JUMP = 0.1  #: A difference that no drift explains, s.

#: A message that was sent this long before the newest one, s, has not been overtaken: networks do
#: not hold messages back for so long.
_RESTART = 1.0

#: Messages in a row that contradict what is known, until the clock is taken to be set.
_CONTRADICTION_LIMIT = 10


class FrameOrder(Enum):
    """Order of a message among those before it, by its times."""

    NEW = "new"  #: Sent after all others.
    OLD = "old"  #: Sent with or before one that has come already: doubled, or overtaken on its way.
    FOREIGN = "foreign"  #: Stamped by another clock: too old, or later than its arrival.
    #: One of the clocks was set; learning restarts with this message.
    RESTART = "restart"


class ClockOffset:
    """Local time from that of a server, whose messages come with varying delay.

    A message that is sent at ``s`` and arrives at ``a`` shows ``a - s = offset +
    delay``. Delays are positive, most of them small and a few large, so that the
    smallest difference of the last five seconds is the offset but for the
    shortest delay, which on a wired network is a fraction of a millisecond. (A
    mean would follow every busy moment.) What has been learned is applied
    smoothly. Silence changes nothing.

    A message that contradicts the others is dropped. Only when they keep coming has a
    clock been set, or the server been restarted, and learning restarts.
    """

    _offset: float | None
    _newest: float | None
    _updated: float
    _contradictions: int

    def __init__(self) -> None:
        self._reset()

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
            # The newest message again, however often, is no sign of another clock.
            self._contradictions += sent != self._newest
            if self._contradictions < _CONTRADICTION_LIMIT:
                return order
            order = FrameOrder.RESTART
        elif self._has_lagged():
            order = FrameOrder.RESTART
        if order is FrameOrder.RESTART:
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

    def _reset(self):
        # Of each bucket: when it began, and its smallest difference.
        self._window: deque[tuple[float, float]] = deque(maxlen=_BUCKETS)
        self._offset = None
        self._updated = 0.0
        self._newest = None
        self._contradictions = 0

    def _shortest(self):
        return min(smallest for _, smallest in self._window)

    def _classify(self, sent, difference):
        if self._newest is None:
            return FrameOrder.NEW
        if sent < self._newest - _RESTART or difference < self._shortest() - _JUMP:
            return FrameOrder.FOREIGN
        return FrameOrder.OLD if sent <= self._newest else FrameOrder.NEW

    def _has_lagged(self):
        # The server's clock was set back by a little, or has stood still.
        return self._offset is not None and self._shortest() > self._offset + _JUMP

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


_INTERVALS = 50  #: Intervals whose median is the period of the stream.
_LEARNING = 10  #: Intervals that must be known before they decide anything.
_STALL = 5.0  #: Periods without a frame, after which the next one may have been waiting.


class ArrivalTimes:
    """Times of frames that come at a steady rate, from the moments at which they are read.

    A reader that is stopped or starved finds the frames of the meantime in a buffer and reads
    them at once: each would be as new as the moment. The frames were sent one period apart, so
    that one that is read less than half a period after the last one was there already, and is
    one period later than the last one. One that had to be waited for came when it was read.

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
        last_read, self._last_read = self._last_read, moment
        if last_read is None:
            self._time = moment
            return moment
        interval = moment - last_read
        if len(self._intervals) < _LEARNING:
            self._intervals.append(interval)
            self._time = moment
            return moment
        period = median(self._intervals)
        was_long, self._is_long = self._is_long, interval > _STALL * period
        if self._is_long:
            if was_long:
                # No backlog has followed: the stream has become slower.
                self._intervals.append(interval)
            self._time += period
            return None
        if interval > 0.5 * period:
            self._time = moment
        else:
            self._time = min(moment, self._time + period)
        if self._time == moment:
            # What is read from a buffer says nothing about the rate.
            self._intervals.append(interval)
        return self._time
