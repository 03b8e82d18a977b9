"""What the last control says about the acceleration of a vehicle."""

import math

import numpy as np

from crazyflie_utils.held import HOLD_LIMIT
from crazyflie_utils.units import GRAVITY

MIN_THRUST, MAX_THRUST = 4.0, 16.0
"""Range of thrust in flight, m/s^2: the limits of the lift controller. With less,
a vehicle stands on the ground or has its motors off; more than that it cannot do."""


def acceleration_from_control(control: np.ndarray, yaw: float) -> np.ndarray:
    """Return the acceleration of a vehicle in free air that follows a control at once.

    The coupled 7-dimensional model: the thrust T along the body's z axis, tilted
    by roll and pitch about the heading, and gravity,
    x_ddot = T (sin(pitch) cos(yaw) + sin(roll) sin(yaw)),
    y_ddot = T (-sin(roll) cos(yaw) + sin(pitch) sin(yaw)),
    z_ddot = T cos(roll) cos(pitch) - g.

    Parameters
    ----------
    control : array_like, shape (4,)
        Roll and pitch in rad, yaw rate in rad/s (of no consequence), thrust in
        m/s^2.
    yaw : float
        rad.

    Returns
    -------
    ndarray, shape (3,)
        m/s^2, fixed frame.
    """
    roll, pitch, _, thrust = control
    forward, left = thrust * math.sin(pitch), -thrust * math.sin(roll)
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            forward * c - left * s,
            left * c + forward * s,
            thrust * math.cos(roll) * math.cos(pitch) - GRAVITY,
        ]
    )


class ControlInput:
    """The last control, for as long as it says something about the motion."""

    def __init__(self):
        self._control = None
        self._time = None

    def command(self, control: np.ndarray, time: float) -> None:
        """Take a control, as in `acceleration_from_control`, given at ``time`` (s)."""
        self._control = control
        self._time = time

    def acceleration(self, yaw: float, time: float) -> np.ndarray | None:
        """Return the acceleration (3,), m/s^2, at a yaw (rad) and time (s), if it is known.

        Returns
        -------
        ndarray or None
            None when there is no control, when it is older than `HOLD_LIMIT`,
            and when its thrust is not one of flight.
        """
        if self._control is None or not 0.0 <= time - self._time <= HOLD_LIMIT:
            return None
        roll, pitch, yaw_dot, thrust = self._control
        if thrust < MIN_THRUST:
            return None
        return acceleration_from_control((roll, pitch, yaw_dot, min(thrust, MAX_THRUST)), yaw)
