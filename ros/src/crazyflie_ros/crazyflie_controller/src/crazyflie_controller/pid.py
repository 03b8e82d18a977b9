"""A PID controller with limits on its output and on its integral."""

from crazyflie_utils.parameters.declaration import Parameters, parameter
from crazyflie_utils.parameters.types import Number

INTEGRATED_ERROR = 0.2
"""Largest error that is integrated, m or rad.

It limits the overshoot at a goal far away. With the gains of Z in config/crazyflie2.yaml a step
of 1 m overshoots by 0.6 m without this limit and by 0.3 m with it; errors below it are not
affected."""

_INTEGRAL = Number("m s or rad s")


class PidParameters(Parameters):
    """Gains and limits of a `SaturatedPid`."""

    kp: float = parameter(Number("output per m or rad"), "gain of the error", live=True)
    kd: float = parameter(
        Number("output per m/s or rad/s"), "gain of the error's rate of change", live=True
    )
    ki: float = parameter(
        Number("output per m s or rad s"), "gain of the error's integral", live=True
    )
    min_output: float = parameter(
        Number("output"), "least output, at most maxOutput", name="minOutput", live=True
    )
    max_output: float = parameter(Number("output"), "largest output", name="maxOutput", live=True)
    integrator_min: float = parameter(
        _INTEGRAL,
        "least integral of the error, at most integratorMax",
        name="integratorMin",
        live=True,
    )
    integrator_max: float = parameter(
        _INTEGRAL, "largest integral of the error", name="integratorMax", live=True
    )


class SaturatedPid:
    """output = kp error + kd slope + ki integral, within limits.

    The integral itself, not its part in the output, is limited against windup; see also
    `INTEGRATED_ERROR`.
    """

    def __init__(self, parameters: PidParameters):
        self._parameters = parameters
        self._integral = 0.0

    @property
    def parameters(self) -> PidParameters:
        """Gains and limits."""
        return self._parameters

    @parameters.setter
    def parameters(self, parameters: PidParameters) -> None:
        # The integral of Z carries the vehicle's weight: its part in the output has to stay.
        output = self._parameters.ki * self._integral
        self._parameters = parameters
        self.reset(output)

    def reset(self, output: float = 0.0) -> None:
        """Set the integral that gives ``output`` without an error, within its limits.

        Without an integral gain it is zero.
        """
        self._integral = 0.0
        if self._parameters.ki != 0.0:
            self._integrate(output / self._parameters.ki)

    def update(self, error: float, slope: float, interval: float) -> float:
        """Return the output for an error (goal minus measurement) and its slope (per s).

        The interval is the time since the last update, s, >= 0.
        """
        gains = self._parameters
        integrated = min(max(error, -INTEGRATED_ERROR), INTEGRATED_ERROR)
        self._integrate(self._integral + integrated * interval)
        output = gains.kp * error + gains.kd * slope + gains.ki * self._integral
        return min(max(output, gains.min_output), gains.max_output)

    def _integrate(self, integral):
        limits = self._parameters
        self._integral = min(max(integral, limits.integrator_min), limits.integrator_max)
