"""Physical constants and unit conversions, each in one place."""

GRAVITY = 9.81
"""Acceleration of free fall, m/s^2; also the mass-normalised thrust of hover."""

HOVER_PWM = 42000.0
"""Thrust command of the radio link (0..65535) at which the vehicle hovers."""


def pwm_from_thrust(thrust: float) -> float:
    """Convert mass-normalised thrust to the link's command, linear through zero.

    Parameters
    ----------
    thrust : float
        m/s^2; ``GRAVITY`` is hover.

    Returns
    -------
    float
        PWM; ``HOVER_PWM`` at hover. Not limited: the driver limits it.
    """
    return thrust * (HOVER_PWM / GRAVITY)


def thrust_from_pwm(pwm: float) -> float:
    """Convert the link's thrust command (PWM) to m/s^2; inverse of `pwm_from_thrust`."""
    return pwm * (GRAVITY / HOVER_PWM)
