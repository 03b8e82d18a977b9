"""Limits of a flight: of positions, controls, pauses of the filter, and publishers."""

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
    SafeSetpoint,
    limited,
)

CLIMB_RESPONSE = 0.1  #: Time constant with which a climb approaches its limit (s).
CLIMB_BRAKING = 4.0  #: Deceleration of a climb below the highest position (m/s^2).
RETURN_RATE = 0.5  #: Rate at which a vehicle above the highest position returns to it (1/s).
LANDING_CLIMB = 0.5  #: Fastest climb of a vehicle that is to land (m/s).
CLIMB_TIMEOUT = 2.0  #: Time of controls that climb too fast after which the flight is ended (s).
MAX_SPEED_CHANGE = 0.5  #: Change of the speed by a control while the filter does not run (m/s).

#: Largest difference between the thrust of a control and that of hover (m/s^2).
_MAX_EXCESS = MAX_THRUST - (1.0 - HOVER_RANGE) * GRAVITY

#: Gap after which the vehicle's z_dot itself is kept within `MAX_SPEED_CHANGE`, since controls that
#: are calculated from states before the gap add up (s).
BUSY_GAP = 0.2
LONGEST_GAP = 1.0  #: Longest gap (s): if the clock steps further, it was set.
GAP_MEMORY = 2.0  #: Time constant with which a gap is forgotten (s).
#: Fraction of the time, averaged over `STARVATION_MEMORY` (s), which a filter that can control a
#: flight may spend in gaps longer than `BUSY_GAP`.
STARVED_SHARE, STARVATION_MEMORY = 0.5, 3.0

OVERLAP = 0.5  #: Time after a message of one node in which one of another node is contention (s).
MEMORY = 5.0  #: Time after which a change of the node is forgotten (s).

DESCENT_TIMEOUT = 1.5  #: Longest time that a vehicle which is to land may stay up (s).
PROGRESS = 0.02  #: Least decrease of the height in a descent (m).


@dataclass(frozen=True)
class Box:
    """The box of the geofence: corners, m, fixed frame; infinite where there is no wall."""

    lower: tuple[float, ...]
    upper: tuple[float, ...]

    def excess(self, position: tuple[float, ...]) -> float:
        """Return how far a position is outside along the worst axis, m; negative inside."""
        (x, y, z), (x_low, y_low, z_low) = position, self.lower
        x_high, y_high, z_high = self.upper
        return max(x_low - x, x - x_high, y_low - y, y - y_high, z_low - z, z - z_high)

    def without_floor(self) -> "Box":
        """Return the box without a floor: a takeoff may begin below it."""
        return Box((*self.lower[:2], -math.inf), self.upper)


NO_BOX = Box((-math.inf,) * 3, (math.inf,) * 3)


@dataclass(frozen=True)
class Limits:
    """Limits of a vehicle in flight."""

    box: Box  # The geofence at the start.
    outside: float  # Largest distance outside the box (m).
    floor: float  # Lowest z (m, fixed frame).
    climb: float  # Largest z_dot that controls may reach (m/s).
    height: float  # Largest height above the ground that controls may reach (m).
    tilt: float = MAX_TILT  # Largest roll and pitch of controls (rad).
    yaw_rate: float = MAX_YAW_RATE  # Largest yaw rate of controls (rad/s).
    thrust: float = MAX_THRUST  # Largest thrust of controls (m/s^2).

    def in_range(self, control: SafeSetpoint, lowest: float) -> SafeSetpoint:
        """Return a finite control with roll, pitch, yaw rate and thrust limited to their ranges.

        ``lowest`` is the least thrust, m/s^2: `MIN_THRUST` in flight.
        """
        return SafeSetpoint(
            limited(control.roll, self.tilt),
            limited(control.pitch, self.tilt),
            limited(control.yaw_dot, self.yaw_rate),
            min(max(control.thrust, lowest), self.thrust),
        )


class Walls:
    """The geofence's box, which may change in flight.

    A vehicle that is outside of a new box may come back: it may be as far outside as it was.
    """

    def __init__(self, limits: Limits):
        self._limits = limits
        self._box = limits.box
        self._granted = 0.0
        self._position: tuple[float, ...] | None = None

    def change(self, box: Box) -> None:
        """Set the box."""
        self._box = box
        if self._position is not None:
            self._granted = max(box.excess(self._position), 0.0)

    def complaint(self, position: tuple[float, ...]) -> str:
        """Return what is wrong with a measured position (m); empty if nothing is."""
        self._position = position
        if position[2] < self._limits.floor:
            return f"{-position[2]:.2f} m below the ground"
        excess = self._box.excess(position)
        self._granted = max(min(self._granted, excess), 0.0)
        too_far = excess > self._limits.outside + self._granted
        return f"{excess:.2f} m outside the geofence" if too_far else ""

    def highest(self, ground: float) -> float:
        """Return the largest z for a climb, m, with the ground at z = ``ground`` (m)."""
        # The geofence, which leaves the vehicle a little room above the wall, acts first.
        ceiling = self._box.upper[2] + 0.5 * self._limits.outside
        return min(ground + self._limits.height, ceiling)


class Debounce:
    """Passes on a complaint that lasts longer than ``duration`` (s)."""

    def __init__(self, duration: float):
        self._duration = duration
        self._lasted = 0.0

    def advance(self, step: float, complaint: str) -> str:
        """Advance by ``step`` (s); return the complaint if it has lasted, else an empty text."""
        self._lasted = self._lasted + step if complaint else 0.0
        return complaint if self._lasted > self._duration else ""


class ClimbLimit:
    """Limits the thrust of a vehicle that would climb too fast, or too high.

    z_dot is at most ``climb`` (m/s), and such that the vehicle can stop below the highest position
    with `CLIMB_BRAKING`.
    """

    def __init__(self, climb: float):
        self._climb = climb
        self._complaint = ""
        self._debounce = Debounce(CLIMB_TIMEOUT)

    def apply(
        self, thrust: float, hover: float, motion: Motion | None, highest: float, is_landing: bool
    ) -> float:
        """Return the limited ``thrust``, m/s^2.

        ``hover`` is the thrust of hover, m/s^2, and ``highest`` the largest z, m. Without a known
        motion the thrust is not limited.
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
        """Return whether `apply` changes no thrust of a vehicle that is not to land."""
        if self._complaint:
            return False
        if motion is None:
            return True
        is_slow = self._climb - motion.velocity[2] > CLIMB_RESPONSE * _MAX_EXCESS
        return is_slow and highest - motion.position[2] > self._climb**2 / CLIMB_BRAKING / 2.0

    def advance(self, step: float) -> str:
        """Advance by ``step`` (s); return which limit was exceeded too long, or an empty text."""
        return self._debounce.advance(step, self._complaint)


class RunGaps:
    """Gaps in which the filter does not run, as on a computer that is too busy.

    Meanwhile the vehicle keeps its last control. So a control may differ from hover by an
    acceleration of `MAX_SPEED_CHANGE` over the longest gap of the last seconds. If this is longer
    than `BUSY_GAP`, the present z_dot is a part of `MAX_SPEED_CHANGE`.
    """

    def __init__(self) -> None:
        self.longest = 0.0  #: Longest gap of the last seconds (s).
        self.time = math.nan  #: Time of the last run (s).
        self._lost = 0.0

    @property
    def complaint(self) -> str:
        """Message that the filter runs too seldom for a flight; empty if it does not."""
        is_starved = self._lost > STARVED_SHARE
        return "this computer is too busy for a flight" if is_starved else ""

    @property
    def is_free(self) -> bool:
        """Whether `apply` changes no control that is in its ranges."""
        return self.longest * _MAX_EXCESS < MAX_SPEED_CHANGE

    def run(self, time: float, longest: float = math.inf) -> None:
        """Record that the filter runs at ``time`` (s).

        If it has run before, since the last call, ``longest`` is the longest gap meanwhile (s).
        """
        elapsed = time - self.time
        self.time = time
        if elapsed > 0.0:
            remembered = self.longest * math.exp(-elapsed / GAP_MEMORY)
            elapsed = min(elapsed, LONGEST_GAP)
            gap = min(elapsed, longest)
            self.longest = max(remembered, gap)
            share = 1.0 - math.exp(-elapsed / STARVATION_MEMORY)
            self._lost += share * (float(gap > BUSY_GAP) - self._lost)

    def apply(
        self, control: SafeSetpoint, hover: float, climb: float = 0.0, is_ramp: bool = False
    ) -> SafeSetpoint:
        """Return the limited control.

        ``hover`` is the thrust of hover, m/s^2. ``climb`` is z_dot, m/s, or 0 if it is not known: a
        fall is ended with `MAX_SUBSTITUTE` at most, and a climb with `MAX_BRAKING`. Of a takeoff
        control (``is_ramp``), which may belong to the ramp of a landing, only thrust above hover is
        limited.
        """
        if self.longest <= 0.0:
            return control
        tilt = math.atan(MAX_SPEED_CHANGE / self.longest / GRAVITY)
        is_busy = self.longest > BUSY_GAP
        rising, sinking = (climb, -climb) if is_busy else (min(climb, 0.0), min(-climb, 0.0))
        most = hover + max((MAX_SPEED_CHANGE - rising) / self.longest, -MAX_BRAKING)
        most = max(most, MIN_THRUST)
        least = min(hover - (MAX_SPEED_CHANGE - sinking) / self.longest, MAX_SUBSTITUTE)
        return SafeSetpoint(
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
        """Advance by ``step`` (s); return a message if the vehicle has not come down, else "".

        ``height`` is in m; None while the vehicle is not to land, or its height is not known.
        """
        complaint = ""
        if height is not None and self._highest is not None and height > self._highest - PROGRESS:
            height = max(self._highest, height)
            complaint = f"the vehicle has not come down for {DESCENT_TIMEOUT:g} s of a landing"
        self._highest = height
        return self._debounce.advance(step, complaint)


class Callers:
    """The nodes that publish on one topic, whose messages are called ``what``.

    A node that takes the place of another one, or is started again, is not a second publisher: a
    change is contention only if the former node has sent within `OVERLAP`. Up to ``tolerance``
    changes within `MEMORY` are a handover.
    """

    def __init__(self, what: str, tolerance: int):
        self.complaint = ""  #: Message that two nodes publish; empty if they do not.
        self._what = what
        self._tolerance = tolerance
        self._now = -math.inf
        self._last: tuple[str, float] | None = None
        self._former = ""
        self._changes: deque[float] = deque(maxlen=tolerance + 1)

    def note(self, time: float, caller: str, overlap: float = OVERLAP) -> None:
        """Record a message of the node ``caller`` (empty: of this process) at ``time`` (s).

        For ``overlap`` (s) see `OVERLAP`.
        """
        self.advance(time)
        if self._last is not None and caller != self._last[0]:
            self._former, sent = self._last
            if time - sent < overlap:
                self._changes.append(time)
        self._last = (caller, time)
        self._update_complaint()

    def renew(self, time: float) -> None:
        """Record another message of the last node at ``time`` (s)."""
        if self._last is not None:
            self._last = (self._last[0], time)

    def advance(self, time: float) -> None:
        """Advance to ``time`` (s)."""
        if time < self._now:
            # The clock was reset.
            self._changes.clear()
            self._last = None if self._last is None else (self._last[0], time)
        self._now = time
        if self._changes or self.complaint:
            while self._changes and time - self._changes[0] > MEMORY:
                self._changes.popleft()
            self._update_complaint()

    def _update_complaint(self):
        if self._last is None or len(self._changes) <= self._tolerance:
            self.complaint = ""
            return
        names = sorted(each or "one of this process" for each in (self._former, self._last[0]))
        self.complaint = f"two nodes publish {self._what}, {' and '.join(names)}; expected one"
