"""Measured motion of a vehicle, its age, and the ground below the vehicle."""

import math
from typing import NamedTuple

from crazyflie_utils.timers import CLOCK_STEP

MAX_FEEDBACK_AGE = 0.2  #: Oldest state that controls the vehicle and its limits (s).
MAX_POSITION_AGE = 0.5  #: Age up to which a position is that of the vehicle (s).
GAP_MEMORY = 5.0  #: Time for which the longest gap between two states is remembered (s).
DRIFT = 0.1  #: Rate at which the usual age of messages may grow (s/s).
MIN_AGE = -0.05  #: Least age of a message that is on time, by its stamp (s).
TOUCHDOWN_HEIGHT = 0.05  #: Largest height of a vehicle that is down where it took off (m).
ON_GROUND_HEIGHT = 0.1  #: Largest height of a vehicle that has not been flown (m).
TOUCHDOWN_SPEED = 0.1  #: Largest speed of a vehicle that is down (m/s).
#: Thrust with which no vehicle stays in the air, as a fraction of that of hover: it passes through
#: speeds below `TOUCHDOWN_SPEED` within 0.1 s.
SINKING_THRUST = 0.75
REST_TIME = 0.3  #: Time for which a vehicle that is down rests with so little thrust (s).
PROGRESS = 0.02  #: Least decrease of the height of a vehicle that sinks (m).
SPEED_AVERAGING = 0.5  #: Time constant of the mean of the vertical speed in a descent (s).

Position = tuple[float, float, float]  #: x, y, z in m, fixed frame, z up.


class Motion(NamedTuple):
    """A measured state."""

    #: position, velocity: m and m/s, fixed frame, z up.
    position: Position
    velocity: tuple[float, float, float]
    yaw: float = 0.0  #: rad.


class Measured:
    """The latest measured motion; times are s of any clock.

    If the clock is reset, the age goes on from there.
    """

    def __init__(self) -> None:
        self.motion: Motion | None = None
        self.missing_reason = ""  #: Why the estimator has no state; empty if it has one.
        self._time = 0.0  # Of the measurement (s).
        # When the last state came, and its age then (s).
        self._received = self._age = 0.0
        self._gap, self._gap_end = 0.0, -math.inf

    def update(self, now: float, motion: Motion, age: float) -> None:
        """Record a motion that is received ``age`` s after it was measured.

        One that is older than the known one does not replace it.
        """
        gap = now - self._received
        if self.motion is not None and (
            gap > self._gap or not 0.0 <= now - self._gap_end < GAP_MEMORY
        ):
            self._gap, self._gap_end = gap, now
        if age <= self.age(now):
            self.motion, self._time = motion, now - age
        self._received, self._age = now, age

    def age(self, now: float) -> float:
        """Return the age of the motion, s; infinite before the first one."""
        if self.motion is None:
            return math.inf
        self._follow_clock(now)
        return now - self._time

    def within(self, now: float, age: float = MAX_FEEDBACK_AGE) -> Motion | None:
        """Return the motion if it is younger than ``age`` (s)."""
        if now < self._received:
            self._follow_clock(now)
        return self.motion if now - self._time < age else None

    def position(self, now: float) -> Position | None:
        """Return the position, m; None when it is older than `MAX_POSITION_AGE`."""
        motion = self.within(now, MAX_POSITION_AGE)
        return None if motion is None else motion.position

    def explanation(self, now: float, topic: str) -> str:
        """Return why the position, from states on ``topic``, is not known; empty if it is."""
        if self.position(now) is not None:
            return ""
        silence = now - self._received
        if self.motion is not None and silence < MAX_POSITION_AGE:
            if self._age < MAX_POSITION_AGE:
                oldest = max(silence, self._gap) + self._age
                return (
                    f"states on {topic} get {oldest:.1f} s old before the next one comes; expected "
                    f"less than {MAX_POSITION_AGE:g} s: is this computer too busy?"
                )
            return (
                f"states on {topic} are {self._age:.1f} s old when they come; do the clocks of all "
                "computers agree, and are they fast enough?"
            )
        why = self.missing_reason or "are the estimator and the source of /tf running?"
        return f"no state has come on {topic} for {MAX_POSITION_AGE:g} s; {why}"

    def _follow_clock(self, now):
        reset = min(now - self._received, 0.0)
        self._received += reset
        self._time += reset


class Delay:
    """Delay of messages relative to their usual age, from the stamps of their data.

    The usual age is the smallest age, which may grow at `DRIFT`. So neither a small offset of
    another machine's clock nor the latency of a source is measured as a delay. After a step of the
    wall clock the measurement restarts; the negative age of a message that was stamped before the
    clock was set back is ignored.
    """

    def __init__(self) -> None:
        self._usual = math.inf
        self._stamp: float | None = None
        self._time = -math.inf
        self._offset = 0.0

    def excess(self, stamp: float, now: float, time: float) -> float:
        """Return the age of a message beyond the usual one, s; at least 0.

        ``stamp`` and ``now`` are wall-clock time, s; ``time`` is now by a clock that is never set,
        s. A stamp that is zero, or repeats, has no age.
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
    """The ground where the vehicle took off, and a touchdown at any height.

    The vehicle took off where it was when the server last sent zero thrust. It may land lower, for
    example next to a table, or higher. So a vehicle that has flown is down if it rests although its
    thrust does not carry it.
    """

    def __init__(self) -> None:
        self.z = 0.0  # Where the vehicle took off (m, fixed frame).
        self._has_flown = False
        self._rest = 0.0
        self._z_dot: float | None = None

    def measure(self, motion: Motion, is_on_ground: bool, in_flight: bool) -> None:
        """Process a measured state, and whether the server reports ground or flight."""
        if is_on_ground:
            self.z, self._has_flown = motion.position[2], False
        elif in_flight or not self.is_below(motion):
            self._has_flown = True

    def begin_descent(self) -> None:
        """Start the measurement of rest and of the mean vertical speed."""
        self._rest, self._z_dot = 0.0, None

    def height(self, motion: Motion) -> float:
        """Return the height above the ground where the vehicle took off, m."""
        return motion.position[2] - self.z

    def advance(self, step: float, motion: Motion | None, thrust: float) -> None:
        """Advance by ``step`` (s) with a thrust, as a fraction of that of hover."""
        rests = motion is not None and abs(motion.velocity[2]) < TOUCHDOWN_SPEED
        self._rest = self._rest + step if rests and thrust < SINKING_THRUST else 0.0
        if motion is None or self._z_dot is None:
            self._z_dot = None if motion is None else motion.velocity[2]
        else:
            share = step / (SPEED_AVERAGING + step)
            self._z_dot += share * (motion.velocity[2] - self._z_dot)

    def sinks(self, motion: Motion | None) -> bool:
        """Return whether a vehicle still sinks, now or on average; False if it is not seen.

        Noise of a single measurement does not show that it is down.
        """
        if motion is None:
            return False
        return is_sinking(motion) or (self._z_dot is not None and self._z_dot <= -TOUCHDOWN_SPEED)

    def has_touched_down(self, motion: Motion | None) -> bool:
        """Return whether a vehicle that is to sink is down; False if its state is not known."""
        if motion is None or is_sinking(motion):
            return False
        is_low = self.height(motion) < TOUCHDOWN_HEIGHT
        return self._rest > REST_TIME or (is_low and not self._has_flown)

    def is_below(self, motion: Motion | None) -> bool:
        """Return whether a vehicle has not been flown; False if its state is not known."""
        return motion is not None and self.height(motion) < ON_GROUND_HEIGHT


def is_sinking(motion: Motion) -> bool:
    """Return whether a vehicle sinks with at least `TOUCHDOWN_SPEED`."""
    return motion.velocity[2] <= -TOUCHDOWN_SPEED
