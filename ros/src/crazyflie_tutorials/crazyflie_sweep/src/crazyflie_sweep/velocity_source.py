"""A velocity from a service, and what to do when it cannot be used."""


class VelocitySource:
    """The last velocity that a service has answered, while it may be used.

    Parameters
    ----------
    limit : float
        How long an answer may be used, s.
    most : float
        A velocity that is not > 0 and <= this is nonsense.
    start : float
        When the service is asked for the first time, s.
    """

    def __init__(self, limit: float, most: float, start: float):
        self._limit = limit
        self._most = most
        self._velocity: float | None = None
        self._time = start
        self._failure = ""
        #: Why there is no velocity; empty while the first answer may still come in time.
        self.reason = ""

    def answer(self, velocity: float, time: float) -> None:
        """Take an answer that has come at ``time`` (s)."""
        if 0.0 < velocity <= self._most:
            self._velocity, self._time, self._failure = velocity, time, ""
        else:
            self._velocity = None
            self._failure = f"it answers {velocity:g}, which is not > 0 and <= {self._most:g}"

    def fail(self, reason: str) -> None:
        """Take note that there was no answer; the last one is used as long as it may be."""
        self._failure = reason

    def velocity(self, time: float) -> float | None:
        """Return the velocity to use at ``time`` (s); None for none, and `reason` says why."""
        # After a reset of the clock the age counts from there.
        self._time = min(self._time, time)
        is_late = time - self._time > self._limit
        if is_late:
            self._velocity = None
        self.reason = ""
        if self._velocity is None:
            self.reason = self._failure
            if is_late and not self._failure:
                self.reason = f"it has not answered for {self._limit:g} s"
        return self._velocity
