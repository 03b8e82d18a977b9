"""The clocks of a process: the machine's steady clock, or simulated time.

``time()`` is for intervals: seconds that never run backwards unless a
simulation is reset. ``stamp(time)`` is for message headers.
"""

import time
from collections.abc import Callable

import genpy

CLOCK_STEP = 0.02  #: A larger change of wall clock minus monotonic clock is a step (s).
_QUIET = 100_000  #: Longest time between two readings that were not interrupted (ns).
#: Drift between wall clock and monotonic clock above which stamps follow (ns).
_OFFSET_TOLERANCE = 1_000_000
_SECOND = 1_000_000_000  #: One second (ns).


def ros_time(nanoseconds: int) -> genpy.Time:
    """Return a time as a message has it, of whole nanoseconds since 1970."""
    # genpy checks the types of its arguments, which takes five times as long.
    time = genpy.Time.__new__(genpy.Time)
    time.secs, time.nsecs = divmod(nanoseconds, _SECOND)
    return time


class SteadyClock:
    """The machine's monotonic clock; stamps are wall-clock time, as ROS has it.

    The same moment always has the same stamp, unless the wall clock is set.
    """

    def __init__(self) -> None:
        self._offset = time.time_ns() - time.monotonic_ns()

    def time(self) -> float:
        """Return seconds since some fixed moment."""
        return time.monotonic_ns() * 1e-9

    def stamp(self, moment: float | None = None) -> genpy.Time:
        """Return the ROS time of a moment of this clock, by default now."""
        return ros_time(self.nanoseconds(moment))

    def nanoseconds(self, moment: float | None = None) -> int:
        """Return the same as `stamp` in whole ns."""
        before = time.monotonic_ns()
        offset = time.time_ns() - before
        # Between two readings another thread may run for milliseconds; a
        # wall clock that was set is seen in the next quiet moment.
        is_quiet = time.monotonic_ns() - before < _QUIET
        if is_quiet and abs(offset - self._offset) > _OFFSET_TOLERANCE:
            self._offset = offset
        return (before if moment is None else round(moment * 1e9)) + self._offset


class SimulatedClock:
    """A clock that stands still until it is set: ROS's simulated time."""

    def __init__(self) -> None:
        self._time = 0.0
        self._listeners: list[Callable[[float, bool], None]] = []

    def time(self) -> float:
        """Return simulated seconds; 0 before the first `set`."""
        return self._time

    def stamp(self, moment: float | None = None) -> genpy.Time:
        """Return a moment of this clock, by default now, as ROS time."""
        return ros_time(self.nanoseconds(moment))

    def nanoseconds(self, moment: float | None = None) -> int:
        """Return the same as `stamp` in whole ns."""
        return round((self._time if moment is None else moment) * 1e9)

    def on_change(self, listener: Callable[[float, bool], None]) -> None:
        """Call ``listener(time, is_reset)`` after every `set`."""
        self._listeners.append(listener)

    def set(self, moment: float) -> None:
        """Move to ``moment`` (s); a step back is a reset of the simulation."""
        is_reset = moment < self._time
        self._time = moment
        for listener in self._listeners:
            listener(moment, is_reset)
