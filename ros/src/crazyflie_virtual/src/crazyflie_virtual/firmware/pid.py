"""A PID controller as the firmware uses them."""


class Pid:
    """PID with feed-forward; the derivative is that of the measurement.

    Parameters
    ----------
    kp, ki, kd : float
        Output per error, per integral of the error, per rate of the measurement.
    kff : float
        Output per desired value.
    dt : float
        Time between two updates, s.
    integral_limit : float
        Of the integral's magnitude, unit of the error times s.
    output_limit : float
        Of the output's magnitude; 0 for none.

    Attributes
    ----------
    desired, out_p, out_i, out_d, out_ff : float
        Of the last update, for the log.
    """

    def __init__(
        self,
        kp: float,
        ki: float,
        kd: float,
        dt: float,
        kff: float = 0.0,
        integral_limit: float = 5000.0,
        output_limit: float = 0.0,
    ):
        self.kp, self.ki, self.kd, self.kff = kp, ki, kd, kff
        self.integral_limit = integral_limit
        self.output_limit = output_limit
        self._dt = dt
        self._integral = 0.0
        self._last = None
        self.desired = 0.0
        self.out_p = self.out_i = self.out_d = self.out_ff = 0.0

    def reset(self) -> None:
        """Forget integral and last measurement."""
        self._integral = 0.0
        self._last = None

    def update(self, desired: float, measured: float, error: float | None = None) -> float:
        """Return the output.

        Parameters
        ----------
        desired, measured : float
        error : float, optional
            In the place of their difference, where it has to be wrapped.
        """
        self.desired = desired
        if error is None:
            error = desired - measured
        limit = self.integral_limit
        integral = self._integral + error * self._dt
        self._integral = integral = -limit if integral < -limit else min(integral, limit)
        slope = 0.0 if self._last is None else (measured - self._last) / self._dt
        self._last = measured
        self.out_p = self.kp * error
        self.out_i = self.ki * integral
        self.out_d = -self.kd * slope
        self.out_ff = self.kff * desired
        output = self.out_p + self.out_i + self.out_d + self.out_ff
        limit = self.output_limit
        if limit > 0.0:
            return -limit if output < -limit else min(output, limit)
        return output
