"""How long a landing takes, and when the vehicle stands.

Where the ground is, is not known: a vehicle may have started from a table, or the origin of its
estimate may be one. Therefore a height is no touchdown: a vehicle is down when it has stopped
sinking although it is commanded to sink.
"""

import enum

SPEED = 0.5  #: Mean speed of a landing, m/s.
STEP, STEP_TIME = 0.5, 1.5  #: Way (m) and duration (s) of a descent below the expected ground.
MAX_DEPTH = 3.0  #: The descents go no further below it, m.
#: So long before a descent ends, and the firmware with it stops the motors, the next begins, s.
LEAD = 0.4

#: A vehicle that stands estimates no more than these, m/s and m, while its target sinks by a way
#: (m), to a distance (m) below it. One that hovers may be above its target, too.
MAX_SPEED, MAX_DROP = 0.1, 0.02
MIN_DISTANCE, MIN_WAY = 0.1, 0.15
HOLD = 0.4  #: So long, s: three samples or more of a log with 10 Hz.


def landing_duration(height: float | None, least: float, most: float) -> float:
    """Return how long a landing from a height (m, None if it is not known) takes, s.

    It is at least ``least``, and at most ``most``, whatever the height.
    """
    return min(least if height is None else max(least, height / SPEED), most)


class Next(enum.Enum):
    """What a landing needs next."""

    NOTHING = enum.auto()
    DESCENT = enum.auto()  #: A descent by `STEP`: no ground was met.
    STOP = enum.auto()  #: The motors stop: the vehicle stands.


class Touchdown:
    """Follow a landing to a height (m) in a duration (s) from ``now`` (s) on."""

    def __init__(self, now: float, height: float, duration: float):
        self._end = now + duration
        self._ground = height
        # Time, height and target when the vehicle was last seen to move.
        self._rest: tuple[float, float, float] | None = None

    def descend(self, now: float) -> None:
        """Note that a descent by `STEP` begins."""
        self._end = now + STEP_TIME

    def sample(
        self, now: float, height: float | None, speed: float | None, target: float | None
    ) -> Next:
        """Return what is needed after an estimate, of which nothing is done without all parts.

        It has height and vertical speed (m and m/s); the target is the height that is commanded.
        """
        if height is None or speed is None or target is None:
            return Next.NOTHING
        if self._stands(now, height, speed, target):
            return Next.STOP
        # Higher up something else has taken the landing's place.
        goes_on = self._ground - MAX_DEPTH <= height - STEP < self._ground
        return Next.DESCENT if goes_on and now >= self._end - LEAD else Next.NOTHING

    def _stands(self, now, height, speed, target):
        if self._rest is None or abs(speed) > MAX_SPEED or abs(height - self._rest[1]) > MAX_DROP:
            self._rest = now, height, target
        since, _, before = self._rest
        is_commanded = before - target >= MIN_WAY and height - target >= MIN_DISTANCE
        return is_commanded and now - since >= HOLD
