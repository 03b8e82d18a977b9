"""The form of a control that the radio driver expects on cmd_vel."""

import math

from crazyflie_model.units import pwm_from_thrust

Vector = tuple[float, float, float]


def cmd_vel_from_control(
    roll: float, pitch: float, yaw_dot: float, thrust: float
) -> tuple[Vector, Vector]:
    """Return the two vectors of the twist that carries a control.

    From rad, rad/s (counter-clockwise) and m/s^2 to linear (pitch in degrees, roll in degrees,
    thrust in PWM, which the driver limits) and angular (0, 0, yaw rate in deg/s, clockwise).
    """
    return (
        (math.degrees(pitch), math.degrees(roll), float(pwm_from_thrust(thrust))),
        (0.0, 0.0, -math.degrees(yaw_dot)),
    )
