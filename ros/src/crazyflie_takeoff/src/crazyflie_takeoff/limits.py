"""Limits of a flight: of places, of controls, of the filter's pauses, and of publishers."""

import math
from collections import deque
from dataclasses import dataclass

from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MAX_YAW_RATE, MIN_THRUST
from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.motion import Motion
from crazyflie_takeoff.safe_control import (
    HOVER_RANGE,
    MAX_BRAKING,
    MAX_SUBSTITUTE,
    Setpoint,
    limited,
)

CLIMB_RESPONSE = 0.1  #: Time constant at which a climb approaches its limit, s.
CLIMB_BRAKING = 4.0  #: Deceleration below the highest place, m/s^2.
RETURN_RATE = 0.5  #: At which a vehicle above the highest place comes back, 1/s.
LANDING_CLIMB = 0.5  #: Climb of a vehicle that is to land, m/s.
CLIMB_TIMEOUT = 2.0  #: Controls that ask for too much climb for longer than this end the flight, s.
#: By which a control may change the speed while the filter does not run, m/s.
MAX_SPEED_CHANGE = 0.5

#: Largest thrust of a control above any thrust of hover, m/s^2.
_MAX_EXCESS = MAX_THRUST - (1.0 - HOVER_RANGE) * GRAVITY

#: A filter that has not run for longer than this, s, keeps the vehicle's z_dot itself within
#: `MAX_SPEED_CHANGE`: controls that are made of states from before the gap add up.
BUSY_GAP = 0.2

#: A filter that has not run in so much of its time, in gaps longer than `BUSY_GAP`, cannot see a
#: vehicle fly; averaged over the latter, s.
STARVED_SHARE, STARVATION_MEMORY = 0.5, 3.0

LONGEST_GAP = 1.0  #: Of a filter that runs, s; a clock that steps further was set.
GAP_MEMORY = 2.0  #: Time constant with which a gap is forgotten, s.

#: A node that takes the place of one that sent less than this before, s, overlaps with it.
OVERLAP = 0.5
MEMORY = 5.0  #: An overlap is forgotten after this, s.

DESCENT_TIMEOUT = 1.5  #: How long a vehicle that is to land may stay up, s.
PROGRESS = 0.02  #: Less than this below where it was highest is no descent, m.


@dataclass(frozen=True)
class Box:
    """The geofence's box: corners, m, fixed frame; infinite where there is no wall."""

    lower: tuple[float, ...]
    upper: tuple[float, ...]

    def excess(self, position: tuple[float, ...]) -> float:
        """Return how far a position is outside along the worst axis, m; negative inside."""
        (x, y, z), (x_low, y_low, z_low) = position, self.lower
        x_high, y_high, z_high = self.upper
        return max(x_low - x, x - x_high, y_low - y, y - y_high, z_low - z, z - z_high)

    def without_floor(self) -> "Box":
        """Return the box open below: a takeoff begins below many a fence."""
        return Box((*self.lower[:2], -math.inf), self.upper)


NO_BOX = Box((-math.inf,) * 3, (math.inf,) * 3)


@dataclass(frozen=True)
class Limits:
    """Limits of a vehicle in flight."""

    box: Box  # Of the geofence at the start.
    outside: float  # Largest distance outside the box, m.
    floor: float  # Lowest z, m, fixed frame.
    climb: float  # Largest z_dot that controls may reach, m/s.
    height: float  # Largest height above the ground that controls may reach, m.


class Walls:
    """The box, which may change in flight, and what lies outside of it.

    A vehicle that new walls leave outside may come back: as far outside as it was is not too far.
    """

    def __init__(self, limits: Limits):
        self._limits = limits
        self._box = limits.box
        self._granted = 0.0
        self._position: tuple[float, ...] | None = None

    def change(self, box: Box) -> None:
        """Take another box."""
        self._box = box
        if self._position is not None:
            self._granted = max(box.excess(self._position), 0.0)

    def complaint(self, position: tuple[float, ...]) -> str:
        """Return in words what is wrong with a measured position (m); nothing if nothing is."""
        self._position = position
        if position[2] < self._limits.floor:
            return f"{-position[2]:.2f} m below the ground"
        excess = self._box.excess(position)
        self._granted = max(min(self._granted, excess), 0.0)
        too_far = excess > self._limits.outside + self._granted
        return f"{excess:.2f} m outside the geofence" if too_far else ""

    def highest(self, ground: float) -> float:
        """Return the z that controls may climb to, m, above a ground at z = ``ground`` (m)."""
        # The fence, which leaves the vehicle a little room above the wall, comes first.
        ceiling = self._box.upper[2] + 0.5 * self._limits.outside
        return min(ground + self._limits.height, ceiling)


class Debounce:
    """Lets a complaint through that lasts longer than ``duration``, s."""

    def __init__(self, duration: float):
        self._duration = duration
        self._lasted = 0.0

    def advance(self, step: float, complaint: str) -> str:
        """Let time pass (s); return the complaint if it has lasted long enough, else no text."""
        self._lasted = self._lasted + step if complaint else 0.0
        return complaint if self._lasted > self._duration else ""


def in_range(control: Setpoint, lowest: float) -> Setpoint:
    """Return a finite control with roll, pitch, yaw rate and thrust within their ranges.

    ``lowest`` is the least thrust, m/s^2: `MIN_THRUST` in flight.
    """
    return Setpoint(
        limited(control.roll, MAX_TILT),
        limited(control.pitch, MAX_TILT),
        limited(control.yaw_dot, MAX_YAW_RATE),
        min(max(control.thrust, lowest), MAX_THRUST),
    )


class ClimbLimit:
    """Lowers the thrust of a vehicle that would climb too fast, or too high.

    The allowed speed depends on the height: at most the limit, and such that the vehicle can stop
    below the highest place with `CLIMB_BRAKING`. ``climb`` is the most z_dot, m/s.
    """

    def __init__(self, climb: float):
        self._climb = climb
        self._complaint = ""
        self._debounce = Debounce(CLIMB_TIMEOUT)

    def apply(
        self, thrust: float, hover: float, motion: Motion | None, highest: float, is_landing: bool
    ) -> float:
        """Return the thrust that is passed on, m/s^2.

        ``thrust`` is asked for, ``hover`` carries the weight, m/s^2; z is not to exceed ``highest``
        (m); without a known motion nothing is limited.
        """
        self._complaint = ""
        if motion is None:
            return thrust
        climb = LANDING_CLIMB if is_landing else self._climb
        left = highest - motion.position[2]
        allowed = math.sqrt(2.0 * CLIMB_BRAKING * left) if left > 0.0 else RETURN_RATE * left
        most = hover + (min(climb, allowed) - motion.velocity[2]) / CLIMB_RESPONSE
        if thrust <= max(most, MIN_THRUST):
            return thrust
        if not is_landing:
            self._complaint = (
                f"the controls climb beyond {highest:.2f} m"
                if allowed < climb
                else f"the controls climb faster than {climb:g} m/s"
            )
        return max(most, MIN_THRUST)

    def is_free(self, motion: Motion | None, highest: float) -> bool:
        """Return whether any thrust is passed on to a vehicle that is not to land."""
        if self._complaint:
            return False
        if motion is None:
            return True
        is_slow = self._climb - motion.velocity[2] > CLIMB_RESPONSE * _MAX_EXCESS
        return is_slow and highest - motion.position[2] > self._climb**2 / CLIMB_BRAKING / 2.0

    def advance(self, step: float) -> str:
        """Let time pass (s); return what has been asked for too long, or an empty text."""
        return self._debounce.advance(step, self._complaint)


class RunGaps:
    """How long the filter does not run, as on a computer that is too busy.

    The vehicle keeps its last control meanwhile. So the longer the gaps, the less may a control
    differ from hover: `MAX_SPEED_CHANGE` divided by the longest gap of the last seconds; less by
    the speed that there is, once that has been longer than `BUSY_GAP`.
    """

    def __init__(self) -> None:
        self._time = math.nan
        self._longest = 0.0
        self._lost = 0.0

    @property
    def complaint(self) -> str:
        """In words, that the filter runs too seldom for a flight; empty if it does not."""
        is_starved = self._lost > STARVED_SHARE
        return "this computer is too busy for a flight" if is_starved else ""

    @property
    def longest(self) -> float:
        """Of the last seconds, s."""
        return self._longest

    @property
    def is_free(self) -> bool:
        """Whether a control in its ranges is passed on unchanged."""
        return self._longest * _MAX_EXCESS < MAX_SPEED_CHANGE

    def run(self, time: float) -> None:
        """Update the gaps: the filter runs at ``time`` (s)."""
        gap = time - self._time
        self._time = time
        if gap > 0.0:
            remembered = self._longest * math.exp(-gap / GAP_MEMORY)
            gap = min(gap, LONGEST_GAP)
            self._longest = max(remembered, gap)
            share = 1.0 - math.exp(-gap / STARVATION_MEMORY)
            self._lost += share * (float(gap > BUSY_GAP) - self._lost)

    def apply(
        self, control: Setpoint, hover: float, climb: float = 0.0, is_ramp: bool = False
    ) -> Setpoint:
        """Return what is passed on of a control.

        ``hover`` is the thrust that carries the weight, m/s^2; ``climb`` is z_dot, m/s, which may
        be ended within a gap; 0 if it is not known. A fall is ended with `MAX_SUBSTITUTE` and a
        climb with `MAX_BRAKING` at most. Of a control that may be of a landing's ramp
        (``is_ramp``), only what is above hover is limited.
        """
        if self._longest <= 0.0:
            return control
        tilt = math.atan(MAX_SPEED_CHANGE / self._longest / GRAVITY)
        is_busy = self._longest > BUSY_GAP
        rising, sinking = (climb, -climb) if is_busy else (min(climb, 0.0), min(-climb, 0.0))
        most = hover + max((MAX_SPEED_CHANGE - rising) / self._longest, -MAX_BRAKING)
        most = max(most, MIN_THRUST)
        least = min(hover - (MAX_SPEED_CHANGE - sinking) / self._longest, MAX_SUBSTITUTE)
        return Setpoint(
            limited(control.roll, tilt),
            limited(control.pitch, tilt),
            control.yaw_dot,
            min(max(control.thrust, -math.inf if is_ramp else least), most),
        )


class DescentWatch:
    """Notices when a vehicle that is to land does not come down."""

    def __init__(self) -> None:
        self._highest: float | None = None
        self._debounce = Debounce(DESCENT_TIMEOUT)

    def advance(self, step: float, height: float | None) -> str:
        """Let time pass (s); return in words what is wrong, or an empty text.

        ``height`` is in m; None while the vehicle is not to land, or its height is not known.
        """
        complaint = ""
        if height is not None and self._highest is not None and height > self._highest - PROGRESS:
            height = max(self._highest, height)
            complaint = f"the vehicle has not come down for {DESCENT_TIMEOUT:g} s of a landing"
        self._highest = height
        return self._debounce.advance(step, complaint)


class Callers:
    """The nodes that publish on one topic: ``what``, in plural.

    A node that takes the place of another one, or is started again, is not a second publisher: a
    change counts only if the former node has sent less than `OVERLAP` before. Up to ``tolerance``
    changes within `MEMORY` are a handover.
    """

    def __init__(self, what: str, tolerance: int):
        self._what = what
        self._tolerance = tolerance
        self._now = -math.inf
        self._last: tuple[str, float] | None = None
        self._former = ""
        self._changes: deque[float] = deque(maxlen=tolerance + 1)

    def note(self, time: float, caller: str, overlap: float = OVERLAP) -> None:
        """Take a message that a node has sent at ``time`` (s); without a name, one of this process.

        For ``overlap``, s, see `OVERLAP`.
        """
        self.advance(time)
        if self._last is not None and caller != self._last[0]:
            self._former, sent = self._last
            if time - sent < overlap:
                self._changes.append(time)
        self._last = (caller, time)

    def renew(self, time: float) -> None:
        """Take another message of the last node, sent at ``time`` (s)."""
        if self._last is not None:
            self._last = (self._last[0], time)

    def advance(self, time: float) -> None:
        """Let time pass until ``time`` (s)."""
        if time < self._now:
            # The clock was reset.
            self._changes.clear()
            self._last = None if self._last is None else (self._last[0], time)
        self._now = time
        while self._changes and time - self._changes[0] > MEMORY:
            self._changes.popleft()

    @property
    def complaint(self) -> str:
        """In words, that there are two; empty if there are not."""
        if self._last is None or len(self._changes) <= self._tolerance:
            return ""
        names = sorted(each or "one of this process" for each in (self._former, self._last[0]))
        return f"two nodes publish {self._what}, {' and '.join(names)}; expected one"
