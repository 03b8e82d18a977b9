"""Kalman filter for signals whose acceleration changes slowly."""

from typing_extensions import override

from crazyflie_state_estimator.motion import Components, RateFilter

#: Default noise of poses (m and rad): that of a poorly calibrated motion capture system.
POSITION_NOISE, ANGLE_NOISE = 0.001, 0.005

#: Default for a vehicle whose control is not known (m/s^2/sqrt(s)). Its tilt is limited to 15
#: degrees, or 2.6 m/s^2, and may go from side to side in a second.
ACCELERATION_WALK = 3.0

#: Default for a known control: wind, and errors of the vehicle's model (m/s^2/sqrt(s)).
ACCELERATION_WALK_WITH_CONTROL = 1.0

#: Default for roll, pitch and yaw, rad/s^2/sqrt(s): with `ANGLE_NOISE` at 100 Hz their rates are
#: followed up to about 40 rad/s.
ANGULAR_ACCELERATION_WALK = 30.0

#: Pause between two samples after which the filter restarts (s): the acceleration known
#: by then is out of date.
MEMORY = 1.0

#: Standard deviations at the first sample (per s and s^2): almost nothing is assumed.
UNKNOWN_RATE, UNKNOWN_ACCELERATION = 10.0, 10.0


class ConstantAccelerationFilter(RateFilter):
    """Kalman filter on the model of constant acceleration, one for each axis.

    Each axis has the state (signal, rate, acceleration). The acceleration is a random walk: its
    unknown part changes in a second by the standard deviation ``acceleration_walk``, in units / s^2
    / sqrt(s). The samples carry independent ``noise``, a standard deviation in units of the signal.
    Model and covariance of the random walk are those of Y. Bar-Shalom, X. R. Li, T. Kirubarajan,
    Estimation with Applications to Tracking and Navigation, 2001, section 6.2.3 (continuous Wiener
    process acceleration). The noise is the same on all axes, so one covariance serves them all. At
    the first sample rate and acceleration have the standard deviations ``first_rate`` and
    ``first_acceleration``.

    An acceleration that is known (from the control) enters by its changes only: they are added to
    the estimate, and the random walk covers the differences between model and vehicle. An
    offset, such as a weak battery or the ground under a vehicle that has too little thrust to leave
    it, is thereby found from the samples, and knowledge that comes or goes causes no jump.

    In between samples of period T the filter follows signals up to about ``(walk**2 / (noise**2 T))
    ** (1/6)`` rad/s and averages faster ones out.
    """

    def __init__(
        self,
        noise: float,
        acceleration_walk: float,
        first_rate: float = UNKNOWN_RATE,
        first_acceleration: float = UNKNOWN_ACCELERATION,
    ):
        self.tune(noise, acceleration_walk)
        self._first_variances = first_rate**2, 0.0, first_acceleration**2
        self._value: list[float] = []
        self._rate: list[float] = []
        self.acceleration: list[float] = []  #: Estimate, the known part included, units / s^2.
        # The upper half, by rows.
        self._covariance = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._known: Components | None = None

    def tune(self, noise: float, acceleration_walk: float) -> None:
        """Change the parameters; the state and its covariance stay."""
        self._noise_variance = noise**2
        self._walk_density = acceleration_walk**2

    @property
    def covariance(self) -> list[list[float]]:
        """Covariance of (signal, rate, acceleration) of any one axis, 3 rows of 3."""
        p00, p01, p02, p11, p12, p22 = self._covariance
        return [[p00, p01, p02], [p01, p11, p12], [p02, p12, p22]]

    @override
    def start(self, value: Components, acceleration: Components | None = None) -> None:
        """Start with the first sample, and the expected acceleration if it is not zero."""
        self._begin(value, [0.0] * len(value))
        self._known = acceleration
        if acceleration is not None:
            self.acceleration = list(acceleration)

    @override
    def step(
        self, dt: float, value: Components, acceleration: Components | None = None
    ) -> tuple[Components, Components]:
        if dt > MEMORY:
            self._begin(value, [(a - b) / dt for a, b in zip(value, self._value, strict=True)])
        else:
            self._take_over(acceleration)
            self._predict(dt)
            self._correct(value)
        return self._value, self._rate

    def _begin(self, value, rate):
        self._value, self._rate = list(value), rate
        self.acceleration = [0.0] * len(rate)
        self._covariance = (self._noise_variance, 0.0, 0.0, *self._first_variances)
        self._known = None

    def _take_over(self, known):
        if known is not None and self._known is not None:
            self.acceleration = [
                acceleration + new - old
                for acceleration, new, old in zip(
                    self.acceleration, known, self._known, strict=True
                )
            ]
        self._known = known

    def _predict(self, dt):
        # x = F x, P = F P F' + Q, written out; F = [[1, dt, dt^2 / 2], [0, 1, dt], [0, 0, 1]].
        half, third, walk = dt * dt / 2.0, dt * dt * dt, self._walk_density
        axes = list(zip(self._value, self._rate, self.acceleration, strict=True))
        self._value = [x + dt * v + half * a for x, v, a in axes]
        self._rate = [v + dt * a for _, v, a in axes]
        p00, p01, p02, p11, p12, p22 = self._covariance
        fp00, fp01, fp02 = (
            p00 + dt * p01 + half * p02,
            p01 + dt * p11 + half * p12,
            p02 + dt * p12 + half * p22,
        )
        fp11, fp12 = p11 + dt * p12, p12 + dt * p22
        self._covariance = (
            fp00 + dt * fp01 + half * fp02 + walk * third * dt * dt / 20.0,
            fp01 + dt * fp02 + walk * third * dt / 8.0,
            fp02 + walk * third / 6.0,
            fp11 + dt * fp12 + walk * third / 3.0,
            fp12 + walk * half,
            p22 + walk * dt,
        )

    def _correct(self, value):
        p00, p01, p02, p11, p12, p22 = self._covariance
        scale = 1.0 / (p00 + self._noise_variance)
        g0, g1, g2 = p00 * scale, p01 * scale, p02 * scale
        innovations = [z - x for z, x in zip(value, self._value, strict=True)]
        self._value = [x + g0 * y for x, y in zip(self._value, innovations, strict=True)]
        self._rate = [v + g1 * y for v, y in zip(self._rate, innovations, strict=True)]
        self.acceleration = [
            a + g2 * y for a, y in zip(self.acceleration, innovations, strict=True)
        ]
        self._covariance = (
            p00 - g0 * p00,
            p01 - g0 * p01,
            p02 - g0 * p02,
            p11 - g1 * p01,
            p12 - g1 * p02,
            p22 - g2 * p02,
        )
