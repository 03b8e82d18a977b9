"""The acceleration of a vehicle that its last control commands."""

from collections.abc import Sequence

from crazyflie_model.dynamics import coupled_acceleration
from crazyflie_model.limits import MAX_THRUST, MIN_THRUST
from crazyflie_utils.last_valid import HOLD_LIMIT


class ControlInput:
    """The last control, while it is informative about the motion."""

    def __init__(self) -> None:
        self._control: Sequence[float] | None = None
        self._time = 0.0

    def command(self, control: Sequence[float], time: float) -> None:
        """Set the control (roll, pitch, yaw rate, thrust; rad, rad/s, m/s^2) at ``time`` (s)."""
        self._control = control
        self._time = time

    def acceleration(self, yaw: float, time: float) -> list[float] | None:
        """Return the acceleration (3,), m/s^2, at a yaw (rad) and time (s).

        None without a control, when it is older than `HOLD_LIMIT`, and when its thrust is less than
        that of flight.
        """
        if self._control is None or not 0.0 <= time - self._time <= HOLD_LIMIT:
            return None
        roll, pitch, yaw_dot, thrust = self._control
        if thrust < MIN_THRUST:
            return None
        thrust = min(thrust, MAX_THRUST)
        return coupled_acceleration((roll, pitch, yaw_dot, thrust), yaw)
