"""The thrust at which a vehicle hovers, measured from its flight.

Speeds are in m/s, z up; thrusts in m/s^2, mass-normalised for a vehicle that hovers at g.
"""

from crazyflie_model.units import GRAVITY

FIRST = 0.5  #: Time of flight as much as which g counts at first, if nothing else is known (s).
#: Range of the thrust of hover (m/s^2).
LEAST_HOVER, MOST_HOVER = 0.6 * GRAVITY, 1.4 * GRAVITY
#: Thrust with which each of them sinks: of one that may be light, and is not seen (m/s^2).
UNSEEN_THRUST = 0.5 * GRAVITY
MOST_ACCELERATION = 2.0 * GRAVITY  #: More is an error of the speed (m/s^2).
LAG = 0.08  #: Time by which motors and estimator make a speed later than its thrust (s).


class HoverThrust:
    """The thrust of hover, by running means over ``averaging`` s; over less at first.

    It begins with ``thrust`` (m/s^2), if that is known, or with g.

    A vehicle that hovers at the thrust h accelerates with (thrust / h - 1) g. So h is g times the
    mean thrust over g plus the mean acceleration, also while the vehicle climbs or stops. The speed
    shows a thrust later than it is sent, so the thrust is delayed by `LAG` first: otherwise what
    begins a climb is taken for weight.
    """

    def __init__(self, averaging: float, thrust: float | None = None) -> None:
        self._averaging = averaging
        # What is known so far counts as much as this time of flight (s).
        self._time = min(FIRST, averaging) if thrust is None else averaging
        self._delayed = self._mean = GRAVITY if thrust is None else thrust
        self._acceleration = 0.0  # Mean (m/s^2).
        self._speed: float | None = None  # The last one (m/s).

    @property
    def value(self) -> float:
        """The thrust, m/s^2, between `LEAST_HOVER` and `MOST_HOVER`."""
        hover = GRAVITY * self._mean / max(GRAVITY + self._acceleration, 0.5 * GRAVITY)
        return min(max(hover, LEAST_HOVER), MOST_HOVER)

    def update(self, step: float, lift: float, speed: float | None) -> None:
        """Process the vertical thrust (m/s^2) that has flown the vehicle for ``step`` (s).

        ``speed`` is the measured z_dot, m/s, or None.
        """
        self._delayed += step / (LAG + step) * (lift - self._delayed)
        share = step / (self._time + step)
        self._time = min(self._time + 0.5 * step, self._averaging)
        self._mean += share * (self._delayed - self._mean)
        if speed is None:
            self._acceleration = 0.0
        elif self._speed is not None:
            acceleration = (speed - self._speed) / step
            acceleration = min(max(acceleration, -MOST_ACCELERATION), MOST_ACCELERATION)
            self._acceleration += share * (acceleration - self._acceleration)
        self._speed = speed

    def skip(self, speed: float | None) -> None:
        """Skip a time in which something else has flown the vehicle, or nothing.

        ``speed`` is the z_dot measured after it, m/s, or None.
        """
        # What has changed the speed meanwhile is not in the mean of the thrust.
        self._delayed, self._speed = self.value, speed
