"""A PID controller as the firmware uses them: with feed-forward, parameters and log variables."""

from math import isnan

from crazyflie_model.pid import Gains, terms


class FirmwarePid:
    """PID with feed-forward; the derivative is that of the measurement.

    ``gains`` hold to begin with: a client may change them. ``dt`` is the time between two updates,
    s; ``kff`` the output per desired value; ``output_limit`` that of the output's magnitude, 0 for
    none.
    """

    def __init__(self, gains: Gains, dt: float, kff: float = 0.0, output_limit: float = 0.0):
        #: kp, ki, kd, kff, limit: Present gains.
        self.kp, self.ki, self.kd, self.kff = gains.kp, gains.ki, gains.kd, kff
        self.limit = gains.limit
        self.output_limit = output_limit
        self._dt = dt
        self._integral = 0.0
        self._last: float | None = None
        #: desired, out_p, out_i, out_d, out_ff: Of the last update, for the log.
        self.desired = 0.0
        self.out_p = self.out_i = self.out_d = self.out_ff = 0.0

    def reset(self) -> None:
        """Forget integral and last measurement."""
        self._integral = 0.0
        self._last = None

    def update(self, desired: float, measured: float, error: float | None = None) -> float:
        """Return the output; ``error`` replaces a difference that has to be wrapped."""
        self.desired = desired
        if error is None:
            error = desired - measured
        slope = 0.0 if self._last is None else (measured - self._last) / self._dt
        self._last = measured
        self.out_p, self.out_i, self.out_d, self._integral = terms(
            # It has the attributes of Gains, but clients change them.
            self,  # type: ignore[arg-type]
            error,
            self._integral,
            slope,
            self._dt,
        )
        self.out_ff = self.kff * desired
        if isnan(self._integral):
            self._integral = -self.limit
        output = self.out_p + self.out_i + self.out_d + self.out_ff
        most = self.output_limit
        return constrain(output, -most, most) if most > 0.0 else output


def constrain(value: float, low: float, high: float) -> float:
    """Return ``value`` limited to [low, high]; ``low`` for what is no number, as C's fmaxf does."""
    return high if value > high else value if value >= low else low
