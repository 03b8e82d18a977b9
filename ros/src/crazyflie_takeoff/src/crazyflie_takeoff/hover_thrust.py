"""The thrust at which a vehicle hovers, measured from its flight.

Speeds are in m/s, z up; thrusts in m/s^2, mass-normalised for a vehicle that hovers at g.
"""

from crazyflie_model.units import GRAVITY

HOVER_RANGE = 0.4  #: Largest deviation of the thrust of hover from g, as a fraction.
LAG = 0.08  #: Time by which motors and estimator make a speed later than its thrust (s).


class HoverThrust:
    """The thrust of hover, by running means with the time constant ``averaging`` (s).

    It begins with ``thrust`` (m/s^2).

    A vehicle that hovers at the thrust h accelerates with (thrust / h - 1) g. So h is g times the
    mean thrust over g plus the mean acceleration, also while the vehicle climbs or stops. Both are
    filtered with the same time constant, by which (v - mean v) / T is the mean acceleration. The
    speed shows a thrust later than it is sent, so the thrust is delayed by `LAG` first: otherwise
    what begins a climb is taken for weight.
    """

    def __init__(self, averaging: float, thrust: float = GRAVITY) -> None:
        self._averaging = averaging
        self._delayed = self._mean = thrust
        self._speed: float | None = None
        self._acceleration = 0.0

    @property
    def value(self) -> float:
        """The thrust, m/s^2, within `HOVER_RANGE` of g."""
        hover = GRAVITY * self._mean / max(GRAVITY + self._acceleration, 0.5 * GRAVITY)
        return min(max(hover, (1.0 - HOVER_RANGE) * GRAVITY), (1.0 + HOVER_RANGE) * GRAVITY)

    def update(self, step: float, lift: float, speed: float | None) -> None:
        """Process the vertical thrust (m/s^2) that has flown the vehicle for ``step`` (s).

        ``speed`` is the measured z_dot, m/s, or None.
        """
        self._delayed += step / (LAG + step) * (lift - self._delayed)
        share = step / (self._averaging + step)
        self._mean += share * (self._delayed - self._mean)
        if speed is None:
            self._speed, self._acceleration = None, 0.0
            return
        if self._speed is None:
            self._continue_from(speed)
            return
        self._speed += share * (speed - self._speed)
        self._acceleration = (speed - self._speed) / self._averaging

    def skip(self, speed: float | None) -> None:
        """Skip a time in which something else has flown the vehicle, or nothing.

        ``speed`` is the z_dot measured after it, m/s, or None.
        """
        # What has changed the speed meanwhile is not in the mean of the thrust.
        self._delayed, self._speed = self.value, None
        if speed is not None:
            self._continue_from(speed)

    def _continue_from(self, speed):
        self._speed = speed - self._averaging * self._acceleration
