"""The PID controller of which all the firmware's controllers are made."""

from dataclasses import dataclass

from crazyflie_model.elementwise import Number, clip


@dataclass(frozen=True)
class Gains:
    """Gains of a PID controller whose derivative is that of the measurement."""

    #: kp, ki, kd: Output per error, per integral of the error, per rate of change of the
    #: measurement.
    kp: float
    ki: float
    kd: float
    #: Of the integral's magnitude, unit of the error times s. The default is the firmware's.
    limit: float = 5000.0


def terms(
    gains: Gains, error: Number, integral: Number, slope: Number, dt: float
) -> tuple[Number, Number, Number, Number]:
    """Return the proportional, integral and derivative part of the output, and the integral.

    ``error`` is the desired minus the measured value, ``integral`` the error's, as returned by the
    last update ``dt`` s ago, ``slope`` the rate of change of the measurement. Any object with the
    attributes of `Gains` does.
    """
    integral = clip(integral + error * dt, -gains.limit, gains.limit)
    return gains.kp * error, gains.ki * integral, -gains.kd * slope, integral
