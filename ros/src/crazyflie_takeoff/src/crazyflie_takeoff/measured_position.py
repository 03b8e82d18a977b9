"""Where the vehicle is, as long as that is known."""

from crazyflie_takeoff.descent import Position

MAX_AGE = 0.5
"""A position that was measured longer ago than this is not used, s."""


class MeasuredPosition:
    """The latest measured position, and how old it is.

    Times are s of any clock; after it has been reset, ages count from there.
    """

    def __init__(self) -> None:
        self._position: Position | None = None
        self._age = 0.0
        self._received = 0.0

    @property
    def is_measured(self) -> bool:
        """Whether there has been any position."""
        return self._position is not None

    def measure(self, time: float, position: Position, age: float) -> None:
        """Take a position (m) that was received at ``time`` and had an age (s) then."""
        self._position, self._received, self._age = position, time, age

    def value(self, time: float) -> Position | None:
        """Return the position, m; None when it is older than `MAX_AGE` at ``time``."""
        is_known = self._silence(time) + self._age < MAX_AGE
        return self._position if is_known else None

    def explanation(self, time: float, topic: str) -> str:
        """Return why the position, which comes as states on a topic, is not known; or nothing."""
        if self.value(time) is not None:
            return ""
        if self._position is not None and self._silence(time) < MAX_AGE:
            return (
                f"states on {topic} are {self._age:.1f} s old when they come; do the clocks of all "
                "computers agree, and are they quick enough?"
            )
        return (
            f"no state has come on {topic} for {MAX_AGE:g} s; are the estimator and the source of "
            "/tf running?"
        )

    def _silence(self, time):
        self._received = min(self._received, time)
        return time - self._received
