"""The liftoff of a vehicle whose thrust of hover is not known.

Speeds are in m/s, z up; thrusts in m/s^2, mass-normalised for a vehicle that hovers at g.
"""

from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.fallback import MAX_BRAKING, MAX_CORRECTION, SETTLING, limited
from crazyflie_takeoff.hover_thrust import HoverThrust

LIFT_OFF_THRUST = GRAVITY + 0.2  #: Default thrust of the open-loop part of a takeoff (m/s^2).
#: Speed of a vehicle that has lifted off (m/s). One that hovers at g reaches it after 1 s of
#: `LIFT_OFF_THRUST`; one that hovers at 0.65 g, after 0.04 s.
LIFT_OFF_SPEED = 0.2
CLIMB_SPEED = 0.1  #: Largest speed of the climb that follows (m/s).
CLIMB_GAIN = 2.0  #: That speed over the distance from the hover point (1/s).
AVERAGING = 0.12  #: Time over which the thrust of hover is averaged (s).


class LiftOff:
    """Thrust of a takeoff until the controller has the vehicle, and the thrust of hover.

    It begins with ``thrust`` (m/s^2).
    """

    def __init__(self, thrust: float = LIFT_OFF_THRUST) -> None:
        self.thrust = thrust  #: The thrust to send, m/s^2.
        self._hover = HoverThrust(AVERAGING, thrust)
        self._is_seen = False
        self.is_lost = False  #: Whether the speed was known, and is not any more.

    @property
    def hover(self) -> float:
        """The thrust of hover, m/s^2."""
        return self._hover.value

    def measure(self, step: float, z_dot: float | None) -> None:
        """Process the vertical speed after ``step`` s with `thrust`; None if it is not known."""
        self._hover.update(step, self.thrust, z_dot)
        self._is_seen = self._is_seen or z_dot is not None
        self.is_lost = self._is_seen and z_dot is None

    def climb(self, distance: float, z_dot: float) -> None:
        """Choose the thrust of a vehicle below the hover point (``distance``, m)."""
        correction = (limited(CLIMB_GAIN * distance, CLIMB_SPEED) - z_dot) / SETTLING
        self.thrust = self.hover + min(max(correction, -MAX_BRAKING), MAX_CORRECTION)


def has_lifted_off(distance: float, z_dot: float) -> bool:
    """Whether a vehicle has lifted off, or must brake for the hover point (``distance``, m)."""
    return z_dot > LIFT_OFF_SPEED or distance < 0.5 * max(z_dot, 0.0) ** 2 / MAX_BRAKING
