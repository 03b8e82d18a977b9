"""Limits of controls: ranges, climb, and how long the vehicle keeps one."""

import math

from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MAX_YAW_RATE, MIN_THRUST
from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.limits import Debounce
from crazyflie_takeoff.motion import Motion
from crazyflie_takeoff.safe_control import MAX_BRAKING, MAX_SUBSTITUTE, Setpoint, limited

CLIMB_RESPONSE = 0.1  #: Time constant at which a climb approaches its limit, s.
CLIMB_BRAKING = 4.0  #: Deceleration below the highest place, m/s^2.
RETURN_RATE = 0.5  #: At which a vehicle above the highest place comes back, 1/s.
LANDING_CLIMB = 0.5  #: Climb of a vehicle that is to land, m/s.
CLIMB_TIMEOUT = 2.0  #: Controls that ask for too much climb for longer than this end the flight, s.
#: By which a control may change the speed while the filter does not run, m/s.
MAX_SPEED_CHANGE = 0.5

#: A filter that has not run for longer than this, s, keeps the vehicle's z_dot itself within
#: `MAX_SPEED_CHANGE`: controls that are made of states from before the gap add up.
BUSY_GAP = 0.2

#: A filter that has not run in so much of its time, in gaps longer than `BUSY_GAP`, cannot see a
#: vehicle fly; averaged over the latter, s.
STARVED_SHARE, STARVATION_MEMORY = 0.5, 3.0

LONGEST_GAP = 1.0  #: Of a filter that runs, s; a clock that steps further was set.
GAP_MEMORY = 2.0  #: Time constant with which a gap is forgotten, s.


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
