"""Where a vehicle is and how it moves, as measured; and the ground below it."""

import math
from typing import NamedTuple

#: A state that is older is not used to control the vehicle, and to watch its limits, s.
MAX_FEEDBACK_AGE = 0.2
MAX_POSITION_AGE = 0.5  #: A position that is older is not where the vehicle is, s.
DRIFT = 0.1  #: How fast the age that is taken for usual may grow, s/s.
MIN_AGE = -0.05  #: A message that is stamped further ahead of now has no usual age, s.
CLOCK_STEP = 0.02  #: A larger change of wall clock minus monotonic clock is a step, s.
TOUCHDOWN_HEIGHT = 0.05  #: A vehicle less than this above where it took off may be down, m.
ON_GROUND_HEIGHT = 0.1  #: A vehicle less than this above the ground has not been flown, m.
TOUCHDOWN_SPEED = 0.1  #: A vehicle that sinks slower than this although it is to sink is down, m/s.

#: No vehicle stays in the air with less thrust than this, as a fraction of that of hover: it
#: passes through speeds below `TOUCHDOWN_SPEED` within 0.1 s.
SINKING_THRUST = 0.75
REST_TIME = 0.3  #: How long a vehicle has to stay where it is with so little thrust, s.

Position = tuple[float, float, float]  #: x, y, z in m, fixed frame, z up.


class Motion(NamedTuple):
    """A measured state."""

    #: position, velocity: m and m/s, fixed frame, z up.
    position: Position
    velocity: tuple[float, float, float]
    yaw: float = 0.0  #: rad.


class Measurement:
    """The last measured state, and its age."""

    def __init__(self) -> None:
        self.age = math.inf  # s; infinite before the first one.
        self._motion: Motion | None = None

    def update(self, motion: Motion, age: float) -> None:
        """Take a state that was measured ``age`` s ago."""
        self._motion, self.age = motion, age

    def advance(self, step: float) -> None:
        """Let time pass, s."""
        self.age += step

    def within(self, age: float) -> Motion | None:
        """Return the state if it is younger than ``age`` (s)."""
        return self._motion if self.age < age else None

    @property
    def fresh(self) -> Motion | None:
        """The state, unless it is older than `MAX_FEEDBACK_AGE`."""
        return self.within(MAX_FEEDBACK_AGE)


class MeasuredPosition:
    """The latest measured position, and how old it is.

    Times are s of any clock; after it has been reset, ages count from there.
    """

    def __init__(self) -> None:
        self._position: Position | None = None
        self._age = 0.0
        self._received = 0.0
        self.missing_reason = ""  #: Why the estimator has no state, as it says; empty if it has.

    @property
    def is_measured(self) -> bool:
        """Whether there has been any position."""
        return self._position is not None

    def measure(self, time: float, position: Position, age: float) -> None:
        """Take a position (m) that was received at ``time`` and had an age (s) then."""
        self._position, self._received, self._age = position, time, age

    def value(self, time: float) -> Position | None:
        """Return the position, m; None when it is older than `MAX_POSITION_AGE` at ``time``."""
        is_known = self._silence(time) + self._age < MAX_POSITION_AGE
        return self._position if is_known else None

    def explanation(self, time: float, topic: str) -> str:
        """Return why the position, which comes as states on a topic, is not known; or nothing."""
        if self.value(time) is not None:
            return ""
        if self._position is not None and self._silence(time) < MAX_POSITION_AGE:
            return (
                f"states on {topic} are {self._age:.1f} s old when they come; do the clocks of all "
                "computers agree, and are they quick enough?"
            )
        why = self.missing_reason or "are the estimator and the source of /tf running?"
        return f"no state has come on {topic} for {MAX_POSITION_AGE:g} s; {why}"

    def _silence(self, time):
        self._received = min(self._received, time)
        return time - self._received


class Delay:
    """How much later than usual messages arrive, by the stamps of their data.

    The usual age is the smallest one, which is taken to grow at `DRIFT`: so a clock of another
    machine that is a little off, or a source that needs its time, makes nothing late. Where the
    wall clock was set, the measurement starts over; a message that was stamped before the clock
    was set back does not make its negative age the usual one.
    """

    def __init__(self) -> None:
        self._usual = math.inf
        self._stamp: float | None = None
        self._time = -math.inf
        self._offset = 0.0

    def excess(self, stamp: float, now: float, time: float) -> float:
        """Return how much older than usual the data of a message are, s; at least 0.

        ``stamp`` and ``now`` are wall-clock time (s), ``time`` is the same moment by a clock that
        is never set (s). A stamp of zero, or the same again, has no age.
        """
        if stamp == 0.0 or stamp == self._stamp:
            return 0.0
        self._stamp = stamp
        if abs(now - time - self._offset) > CLOCK_STEP:
            self._usual = math.inf
        self._offset = now - time
        age = now - stamp
        usual = self._usual + DRIFT * max(time - self._time, 0.0)
        self._usual = min(age if age >= MIN_AGE else 0.0, usual)
        self._time = time
        return max(age - self._usual, 0.0)


class Ground:
    """The ground from which the vehicle took off, and the one on which it comes to rest.

    The former is where it was when the server last sent zero thrust. The latter may be lower, as
    beside a table, or higher; so what has flown is down where it stays without enough thrust.
    """

    def __init__(self) -> None:
        self.z = 0.0  # Of the place of the takeoff, m, fixed frame.
        self._has_flown = False
        self._rest = 0.0

    def measure(self, motion: Motion, is_on_ground: bool, in_flight: bool) -> None:
        """Take a measured state, with what the server says of the vehicle."""
        if is_on_ground:
            self.z, self._has_flown = motion.position[2], False
        elif in_flight or not self.is_below(motion):
            self._has_flown = True

    def begin_descent(self) -> None:
        """Forget where the vehicle rested before."""
        self._rest = 0.0

    def height(self, motion: Motion) -> float:
        """Return the height of a vehicle above the place of the takeoff, m."""
        return motion.position[2] - self.z

    def advance(self, step: float, motion: Motion | None, thrust: float) -> None:
        """Let time pass (s) with a thrust, as a fraction of that of hover."""
        rests = motion is not None and abs(motion.velocity[2]) < TOUCHDOWN_SPEED
        self._rest = self._rest + step if rests and thrust < SINKING_THRUST else 0.0

    def has_touched_down(self, motion: Motion | None) -> bool:
        """Whether a vehicle that is to sink is down; not if its state is not known."""
        if motion is None or is_sinking(motion):
            return False
        is_low = self.height(motion) < TOUCHDOWN_HEIGHT
        return self._rest > REST_TIME or (is_low and not self._has_flown)

    def is_below(self, motion: Motion | None) -> bool:
        """Whether a vehicle is on the ground; not if its state is not known."""
        return motion is not None and self.height(motion) < ON_GROUND_HEIGHT


def is_sinking(motion: Motion) -> bool:
    """Return whether a vehicle sinks with at least `TOUCHDOWN_SPEED`."""
    return motion.velocity[2] <= -TOUCHDOWN_SPEED
