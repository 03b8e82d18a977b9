"""The age of states, also of those with stamps of another clock."""

import math

from crazyflie_utils.timers import CLOCK_STEP

#: Difference above which two clocks are unrelated (s): one of them is simulated, or is that of a
#: bag.
SAME_CLOCK = 60.0

_DRIFT = 1e-3  #: Largest relative drift of unrelated clocks (s/s).


class StateAge:
    """Estimates the age of states, also if their stamps are of another clock.

    A stamp that is within `SAME_CLOCK` of now is of this machine's clock, and so are all later
    ones: a stamp of minutes ago is then old. Before that, the smallest difference between now
    and a stamp is the offset of the other clock, and the age is the rest. The measurement
    restarts if stamps of another clock repeat or go back, and if this machine's clock was set.
    """

    def __init__(self) -> None:
        self._offset = math.inf  # Infinite if it is not known; 0 for this machine's clock.
        self._stamp = self._time = self._wall_offset = 0.0

    def update(self, stamp: float, now: float, time: float) -> float:
        """Return the age, s, of a state with a stamp (s; 0: no stamp); negative in the future.

        ``stamp`` and ``now`` are wall-clock time (s), ``time`` is the same moment by a clock that
        is never set (s).
        """
        if stamp == 0.0:
            return 0.0
        difference, elapsed = now - stamp, time - self._time
        # Simulated time was reset, or the wall clock was set.
        if elapsed < 0.0 or abs(now - time - self._wall_offset) > CLOCK_STEP:
            self._offset = math.inf
        if abs(difference) <= SAME_CLOCK:
            self._offset = 0.0
        elif self._offset != 0.0:
            usual = math.inf if stamp <= self._stamp else self._offset + _DRIFT * elapsed
            self._offset = min(usual, difference)
        self._stamp, self._time, self._wall_offset = stamp, time, now - time
        return difference - self._offset
