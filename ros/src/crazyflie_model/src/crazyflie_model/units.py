"""Physical constants and unit conversions, each in one place."""

from crazyflie_model.elementwise import Number

GRAVITY = 9.81  #: Acceleration of free fall (m/s^2); also the mass-normalised thrust of hover.
HOVER_PWM = 42000.0  #: Thrust command of the radio link (0..65535) at which the vehicle hovers.


def pwm_from_thrust(thrust: Number) -> Number:
    """Convert mass-normalised thrust, m/s^2, to the link's command, PWM, linear through zero.

    Not limited: the driver limits it.
    """
    return thrust * (HOVER_PWM / GRAVITY)


def thrust_from_pwm(pwm: Number) -> Number:
    """Convert the link's thrust command (PWM) to m/s^2; inverse of `pwm_from_thrust`."""
    return pwm * (GRAVITY / HOVER_PWM)
