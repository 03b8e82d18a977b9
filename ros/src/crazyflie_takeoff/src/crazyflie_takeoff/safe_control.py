"""What the control filter flies by itself when no control comes.

The attitude is level and the yaw rate zero. The thrust is that of hover, as learned in flight,
corrected such that the vertical speed follows a target: zero while the filter waits for the
controller, then slowly more and more downwards. The speed is measured, or, when no state comes
either, dead-reckoned from the last one by z'' = thrust - hover thrust. So a vehicle that was
climbing when its pose was lost is stopped first; and one whose hover thrust is off by
less than `SINK_RATE` comes down all the same.
"""

import math
from typing import NamedTuple

from crazyflie_model.units import GRAVITY

HOVER_RANGE = 0.25
"""How far the hover thrust may be from g, as a fraction."""

AVERAGING = 2.0
"""Time constant of the mean of the commanded thrust, s."""

SINK_RATE = 0.3
"""How fast the target speed goes down in a descent, m/s^2: without a state the thrust is as much
below hover. From 1 m a vehicle meets the ground at 0.7 m/s, from 2 m at 1.0 m/s."""

SINK_SPEED = 0.4
"""The target speed goes down to this while the speed is measured, m/s."""

SETTLING = 0.3
"""Time constant at which the speed follows its target, s."""

MAX_CORRECTION = 0.2 * GRAVITY
"""Most that the thrust differs from hover, m/s^2."""

MAX_SUBSTITUTE = (1.0 + HOVER_RANGE) * GRAVITY
"""Most thrust that the filter gives by itself, m/s^2."""

RETURN_TIME = 0.2
"""How long the change from the filter's control back to the controller's takes, s."""


class Setpoint(NamedTuple):
    """A control: roll and pitch in rad, yaw rate in rad/s, thrust in m/s^2."""

    roll: float
    pitch: float
    yaw_dot: float
    thrust: float

    def mixed(self, other: "Setpoint", weight: float) -> "Setpoint":
        """Return this one, with another that has a weight (0 ... 1)."""
        return Setpoint(*(a + weight * (b - a) for a, b in zip(self, other, strict=True)))


MOTORS_OFF = Setpoint(0.0, 0.0, 0.0, 0.0)


class HoverThrust:
    """The thrust at which a vehicle hovers: a running mean of what is commanded in flight.

    Both the vertical part of the thrust and the vertical speed v are filtered with the time
    constant T (`AVERAGING`). As (v - mean v) / T is the filtered acceleration, subtracting it
    leaves the thrust that carries the weight, also while the vehicle climbs or has just stopped.
    """

    def __init__(self) -> None:
        self._thrust = GRAVITY
        self._speed: float | None = None
        self._acceleration = 0.0

    @property
    def value(self) -> float:
        """m/s^2, within `HOVER_RANGE` of g."""
        return _limited(self._thrust - self._acceleration, HOVER_RANGE * GRAVITY, GRAVITY)

    def update(self, step: float, control: Setpoint, speed: float | None) -> None:
        """Take a control that flies the vehicle.

        Parameters
        ----------
        step : float
            Since the last one, s.
        control : Setpoint
        speed : float or None
            Measured z_dot, m/s.
        """
        share = step / (AVERAGING + step)
        vertical = control.thrust * math.cos(control.roll) * math.cos(control.pitch)
        self._thrust += share * (vertical - self._thrust)
        if speed is None:
            self._speed, self._acceleration = None, 0.0
            return
        mean = speed if self._speed is None else self._speed + share * (speed - self._speed)
        self._speed, self._acceleration = mean, (speed - mean) / AVERAGING


class SafeControl:
    """Hover and descent without a controller.

    Parameters
    ----------
    hover : float
        Thrust of hover, m/s^2.
    speed : float
        z_dot at the beginning, m/s; 0 if it is not known.
    """

    def __init__(self, hover: float, speed: float):
        self._hover = hover
        self._speed = speed
        self._target = 0.0

    def advance(self, step: float, measured: float | None, sinks: bool) -> Setpoint:
        """Return the control of the next ``step`` (s).

        Parameters
        ----------
        step : float
        measured : float or None
            z_dot, m/s.
        sinks : bool
            Whether the vehicle is to come down.
        """
        if measured is not None:
            self._speed = measured
        if sinks:
            lowest = -math.inf if measured is None else -SINK_SPEED
            self._target = max(self._target - SINK_RATE * step, lowest)
        correction = _limited((self._target - self._speed) / SETTLING, MAX_CORRECTION)
        thrust = min(self._hover + correction, MAX_SUBSTITUTE)
        self._speed += (thrust - self._hover) * step
        return Setpoint(0.0, 0.0, 0.0, thrust)


def _limited(value, limit, centre=0.0):
    return min(max(value, centre - limit), centre + limit)
