"""The limits of a flight, and controls within them.

Thrusts are in m/s^2; positions in m and velocities in m/s, fixed frame, z up.
"""

import math
from dataclasses import dataclass

from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MAX_YAW_RATE, MIN_THRUST
from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.fallback import MAX_BRAKING, MAX_SUBSTITUTE, SafeSetpoint, limited
from crazyflie_takeoff.hover_thrust import LEAST_HOVER
from crazyflie_takeoff.motion import Motion

CLIMB_RESPONSE = 0.1  #: Time constant with which a climb approaches its limit (s).
CLIMB_BRAKING = 4.0  #: Deceleration of a climb below the highest position (m/s^2).
RETURN_RATE = 0.5  #: Rate at which a vehicle above the highest position returns to it (1/s).
LANDING_CLIMB = 0.5  #: Fastest climb of a vehicle that is to land (m/s).
TAKEOFF_CLIMB = 1.0  #: Fastest climb by takeoff controls (m/s).
MAX_SPEED_CHANGE = 0.5  #: Change of the speed by a control while the filter does not run (m/s).
#: Pause of the filter after which the vehicle's z_dot itself is kept within `MAX_SPEED_CHANGE`,
#: since controls that are calculated from states before the pause add up (s).
LONG_PAUSE = 0.2

#: Largest difference between the thrust of a control and that of hover (m/s^2).
_MAX_EXCESS = MAX_THRUST - LEAST_HOVER


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


def hover_complaint(hover: tuple[float, float, float], box: Box) -> str:
    """Return in words what is wrong with a hover point (m) in a box; empty if nothing is."""
    excess = box.excess(hover)
    if excess <= 0.0:
        return ""
    return (
        f"hover/x, y, z is {hover}, {excess:.2f} m outside the geofence; expected a point in the "
        "box"
    )


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

    def contain(self, control: SafeSetpoint) -> bool:
        """Return whether a control of a flight (with these fields) is in its ranges."""
        return (
            -self.tilt <= control.roll <= self.tilt
            and -self.tilt <= control.pitch <= self.tilt
            and MIN_THRUST <= control.thrust <= self.thrust
            and -self.yaw_rate <= control.yaw_dot <= self.yaw_rate
        )

    def in_range(self, control: SafeSetpoint, lowest: float) -> SafeSetpoint:
        """Return a finite control with roll, pitch, yaw rate and thrust limited to their ranges.

        ``lowest`` is the least thrust: `MIN_THRUST` in flight.
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


def within_climb(
    thrust: float, hover: float, motion: Motion | None, highest: float, climb: float
) -> tuple[float, str]:
    """Return a thrust with which the vehicle climbs neither too fast nor too high, and why.

    z_dot is to be at most ``climb``, and such that the vehicle can stop below z = ``highest`` with
    `CLIMB_BRAKING`. ``hover`` is the thrust of hover. Without a known motion the thrust stays. The
    text says which limit the thrust exceeds; it is empty if it exceeds none.
    """
    if motion is None:
        return thrust, ""
    left = highest - motion.position[2]
    allowed = math.sqrt(2.0 * CLIMB_BRAKING * left) if left > 0.0 else RETURN_RATE * left
    most = max(hover + (min(climb, allowed) - motion.velocity[2]) / CLIMB_RESPONSE, MIN_THRUST)
    if thrust <= most:
        return thrust, ""
    if allowed < climb:
        return most, f"the controls climb beyond {highest:.2f} m"
    return most, f"the controls climb faster than {climb:g} m/s"


def cannot_climb_too_far(motion: Motion | None, highest: float, climb: float) -> bool:
    """Return whether `within_climb` changes no thrust that is in its range."""
    if motion is None:
        return True
    is_slow = climb - motion.velocity[2] > CLIMB_RESPONSE * _MAX_EXCESS
    return is_slow and highest - motion.position[2] > climb**2 / CLIMB_BRAKING / 2.0


def within_pause(
    control: SafeSetpoint, pause: float, hover: float, climb: float = 0.0, is_ramp: bool = False
) -> SafeSetpoint:
    """Return a control that may fly the vehicle through a pause of the filter, s.

    The vehicle keeps its last control meanwhile. So a control may differ from hover by an
    acceleration of `MAX_SPEED_CHANGE` over the pause. After a `LONG_PAUSE`, ``climb`` (the present
    z_dot, or 0 if it is not known) is a part of `MAX_SPEED_CHANGE`. ``hover`` is the thrust of
    hover; a fall is ended with `MAX_SUBSTITUTE` at most, and a climb with `MAX_BRAKING`. Of a
    takeoff control (``is_ramp``), which may belong to the ramp of a landing, only thrust above
    hover is limited.
    """
    if pause <= 0.0:
        return control
    tilt = math.atan(MAX_SPEED_CHANGE / pause / GRAVITY)
    is_long = pause > LONG_PAUSE
    rising, sinking = (climb, -climb) if is_long else (min(climb, 0.0), min(-climb, 0.0))
    most = max(hover + max((MAX_SPEED_CHANGE - rising) / pause, -MAX_BRAKING), MIN_THRUST)
    least = min(hover - (MAX_SPEED_CHANGE - sinking) / pause, MAX_SUBSTITUTE)
    return SafeSetpoint(
        limited(control.roll, tilt),
        limited(control.pitch, tilt),
        control.yaw_dot,
        min(max(control.thrust, -math.inf if is_ramp else least), most),
    )


def is_any_within_pause(pause: float) -> bool:
    """Return whether `within_pause` changes no control that is in its ranges."""
    return pause * _MAX_EXCESS < MAX_SPEED_CHANGE
