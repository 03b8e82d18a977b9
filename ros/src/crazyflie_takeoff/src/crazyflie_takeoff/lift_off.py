"""The liftoff of a vehicle whose thrust of hover is not known.

Speeds are in m/s, z up; thrusts in m/s^2, mass-normalised for a vehicle that hovers at g.
"""

import math

from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.fallback import MAX_BRAKING, MAX_CORRECTION, SETTLING, limited
from crazyflie_takeoff.hover_thrust import HoverThrust
from crazyflie_takeoff.motion import MAX_FEEDBACK_AGE

LIFT_OFF_THRUST = GRAVITY + 0.2  #: Default thrust of the open-loop part of a takeoff (m/s^2).
#: Speed of a vehicle that has lifted off (m/s). One that hovers at g reaches it after 1 s of
#: `LIFT_OFF_THRUST`; one that hovers at 0.65 g, after 0.04 s.
LIFT_OFF_SPEED = 0.2
CLIMB_SPEED = 0.1  #: Largest speed of the climb that follows (m/s).
CLIMB_GAIN = 2.0  #: That speed over the distance from the hover point (1/s).
KNOWN_TIME = 0.2  #: Time in which a vehicle that hovers at 0.85 g shows it (s): its motors lag.
#: Largest acceleration of one that does not, over that of a vehicle that hovers at g.
KNOWN_ACCELERATION = 1.25
AVERAGING = 0.12  #: Time over which the thrust of hover is averaged (s).


class LiftOff:
    """Thrust of a takeoff until the controller has the vehicle, and the thrust of hover.

    It begins with ``thrust`` (m/s^2).
    """

    def __init__(self, thrust: float = LIFT_OFF_THRUST) -> None:
        self.thrust = thrust  #: The thrust to send, m/s^2.
        self._hover = HoverThrust(AVERAGING, thrust)
        self.is_lost = False  #: Whether the speed was known, and is not any more.
        self._seen: float | None = None  # Time for which the speed was known (s); None before.
        self._z_dot = 0.0  # The last speed that was known (m/s).

    @property
    def hover(self) -> float:
        """The thrust of hover, m/s^2."""
        return self._hover.value

    def measure(self, step: float, z_dot: float | None) -> None:
        """Process the vertical speed after ``step`` s with `thrust`; None if it is not known."""
        was_lost, self.is_lost = self.is_lost, z_dot is None and self._seen is not None
        if self.is_lost or was_lost:
            self._hover.skip(z_dot)
        else:
            self._hover.update(step, self.thrust, z_dot)
        if z_dot is not None:
            self._z_dot = z_dot
            self._seen = 0.0 if self._seen is None else self._seen + step

    @property
    def is_known(self) -> bool:
        """Whether a vehicle that has not lifted off yet is not one that hovers at much less."""
        seen = -math.inf if self._seen is None else self._seen - MAX_FEEDBACK_AGE
        speed = KNOWN_ACCELERATION * (LIFT_OFF_THRUST - GRAVITY) * seen
        return seen > KNOWN_TIME and self._z_dot < speed

    def climb(self, distance: float, z_dot: float) -> None:
        """Choose the thrust of a vehicle below the hover point (``distance``, m)."""
        correction = (limited(CLIMB_GAIN * distance, CLIMB_SPEED) - z_dot) / SETTLING
        self.thrust = self.hover + min(max(correction, -MAX_BRAKING), MAX_CORRECTION)


def has_lifted_off(distance: float, z_dot: float) -> bool:
    """Whether a vehicle has lifted off, or must brake for the hover point (``distance``, m)."""
    return z_dot > LIFT_OFF_SPEED or distance < 0.5 * max(z_dot, 0.0) ** 2 / MAX_BRAKING
