"""When frames arrived that were read late, for a stream without time stamps."""

from collections import deque
from statistics import median

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
