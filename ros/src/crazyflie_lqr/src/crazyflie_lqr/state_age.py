"""The age of states, by their stamps."""

#: Clocks that differ by more than this, s, are not meant to agree: one of them is simulated, or is
#: that of a bag.
SAME_CLOCK = 60.0

_DRIFT = 1e-3  #: By how much clocks that are not meant to agree may run apart, s/s.


class StateAge:
    """Tells how old states are, also where their stamps are of another clock.

    A stamp that is within `SAME_CLOCK` of now is of this machine's clock, and from then on
    all are: one that is minutes old then is old. Before that, what is known of the other clock
    is the least by which a stamp was behind now, and the age is what is more than that.
    Stamps of another clock that repeat or go back say nothing, and begin anew.
    """

    def __init__(self) -> None:
        self._offset: float | None = None
        self._stamp = self._now = 0.0

    def update(self, stamp: float, now: float) -> float:
        """Return the age, s, of a state with a stamp (s; 0 is none); negative in the future."""
        if stamp == 0.0:
            return 0.0
        difference, elapsed = now - stamp, now - self._now
        if elapsed < 0.0:
            # Simulated time was reset.
            self._offset = None
        if abs(difference) <= SAME_CLOCK:
            self._offset = 0.0
        elif self._offset is None or (self._offset != 0.0 and stamp <= self._stamp):
            self._offset = difference
        elif self._offset != 0.0:
            self._offset = min(self._offset + _DRIFT * elapsed, difference)
        self._stamp, self._now = stamp, now
        return difference - self._offset
