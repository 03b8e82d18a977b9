"""A PID controller with limits on its output and on its integral."""

from dataclasses import dataclass

INTEGRATED_ERROR = 0.2
"""What of an error enters the integral at most, m or rad.

On the way to a goal far away the integral would otherwise gather what it can only get rid
of beyond the goal. With the gains of Z in config/crazyflie2.yaml a step of 1 m overshoots
by 0.6 m without this limit and by 0.3 m with it; errors below it are not affected."""


@dataclass(frozen=True)
class Gains:
    """Gains and limits of a `Pid`.

    Attributes
    ----------
    kp, kd, ki : float
        Output per error, per rate of change of the error, per integral of the error.
    min_output, max_output : float
        Limits of the output.
    integrator_min, integrator_max : float
        Limits of the integral of the error (not of its part in the output), so
        that an error that lasts does not wind it up; see also `INTEGRATED_ERROR`.
    """

    kp: float
    kd: float
    ki: float
    min_output: float
    max_output: float
    integrator_min: float
    integrator_max: float


class Pid:
    """output = kp error + kd slope + ki integral, within limits.

    Parameters
    ----------
    gains : Gains
    """

    def __init__(self, gains: Gains):
        self._gains = gains
        self._integral = 0.0

    @property
    def gains(self) -> Gains:
        """Gains and limits."""
        return self._gains

    def reset(self, output: float = 0.0) -> None:
        """Forget what has been; the integral is what gives ``output`` without an error.

        Without an integral gain, and beyond the limits of the integral, it is as near to
        that as it can be.
        """
        self._integral = 0.0
        if self._gains.ki != 0.0:
            self._integrate(output / self._gains.ki)

    def update(self, error: float, slope: float, interval: float) -> float:
        """Return the output.

        Parameters
        ----------
        error : float
            Goal minus measurement.
        slope : float
            Rate of change of the error, per s.
        interval : float
            Time since the last update, s, >= 0.
        """
        gains = self._gains
        integrated = min(max(error, -INTEGRATED_ERROR), INTEGRATED_ERROR)
        self._integrate(self._integral + integrated * interval)
        output = gains.kp * error + gains.kd * slope + gains.ki * self._integral
        return min(max(output, gains.min_output), gains.max_output)

    def _integrate(self, integral):
        self._integral = min(max(integral, self._gains.integrator_min), self._gains.integrator_max)
