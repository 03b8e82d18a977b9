"""The motion of a vehicle from its stamped poses, by finite differences or a Kalman filter."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import NamedTuple

from typing_extensions import override

from crazyflie_model.angles import wrap_to_pi

#: One number for each axis. For so few, plain floats are several times quicker than arrays.
Components = Sequence[float]
#: Least time between two poses (s): no source is quicker, so nearer stamps are wrong.
LEAST_STEP = 0.0005


class RateFilter(ABC):
    """Signal and rate of n independent axes, from samples of the signal."""

    @abstractmethod
    def start(self, value: Components) -> None:
        """Restart with the first sample, n components."""

    @abstractmethod
    def step(
        self, dt: float, value: Components, acceleration: Components | None = None
    ) -> tuple[Components, Components]:
        """Process the next sample; return the signal at its time, and its rate per second.

        The sample is ``dt`` s after the last one (positive) and has n components, as has the
        acceleration commanded since then, if it is known. Not every filter uses it.
        """


class FiniteDifference(RateFilter):
    """The signal as it is sampled, and the difference quotient of its last two samples.

    The quotient is exact for linear signals; otherwise it is the rate half a period ago, up to
    second order. Independent noise of standard deviation s on the samples becomes sqrt(2) s / dt on
    the rate; so samples that come sooner than ``least_step`` (s) after one another leave the rate
    as it was, until so much time has passed.
    """

    def __init__(self, least_step: float = LEAST_STEP):
        self._least_step = least_step

    @override
    def start(self, value: Components) -> None:
        self._value = value
        self._elapsed = 0.0
        self._rate: Components = [0.0] * len(value)

    @override
    def step(
        self, dt: float, value: Components, acceleration: Components | None = None
    ) -> tuple[Components, Components]:
        self._elapsed += dt
        if self._elapsed >= self._least_step:
            elapsed = self._elapsed
            self._rate = [(a - b) / elapsed for a, b in zip(value, self._value, strict=True)]
            self._value, self._elapsed = value, 0.0
        return value, self._rate


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
        self.value: list[float] = []  #: Estimate, units.
        self.rate: list[float] = []  #: Estimate, units / s.
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
            self._begin(value, [(a - b) / dt for a, b in zip(value, self.value, strict=True)])
        else:
            self.predict(dt, acceleration)
            self.correct(value)
        return self.value, self.rate

    def _begin(self, value, rate):
        self.value, self.rate = list(value), rate
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

    def predict(self, dt: float, acceleration: Components | None = None) -> None:
        """Predict to ``dt`` (s) later, with the acceleration known since then, n components."""
        self._take_over(acceleration)
        # x = F x, P = F P F' + Q, written out; F = [[1, dt, dt^2 / 2], [0, 1, dt], [0, 0, 1]].
        half, third, walk = dt * dt / 2.0, dt * dt * dt, self._walk_density
        axes = list(zip(self.value, self.rate, self.acceleration, strict=True))
        self.value = [x + dt * v + half * a for x, v, a in axes]
        self.rate = [v + dt * a for _, v, a in axes]
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

    def correct(self, value: Components) -> None:
        """Correct by a sample of the time that was predicted to, n components."""
        p00, p01, p02, p11, p12, p22 = self._covariance
        scale = 1.0 / (p00 + self._noise_variance)
        g0, g1, g2 = p00 * scale, p01 * scale, p02 * scale
        innovations = [z - x for z, x in zip(value, self.value, strict=True)]
        self.value = [x + g0 * y for x, y in zip(self.value, innovations, strict=True)]
        self.rate = [v + g1 * y for v, y in zip(self.rate, innovations, strict=True)]
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


class EstimatedMotion(NamedTuple):
    """Position, velocity, attitude and attitude rate of a vehicle, in the fixed frame."""

    position: Components  #: x, y, z in m.
    velocity: Components  #: x_dot, y_dot, z_dot (m/s).
    attitude: Components  #: Roll, pitch, yaw in rad, in [-pi, pi]; see `crazyflie_model.angles`.
    #: Time derivatives of roll, pitch, yaw in rad/s (not the body's angular velocity).
    attitude_rate: Components


#: A larger change between wall clock and monotonic clock, or between the stamps of poses and their
#: arrivals, is a step (s).
STAMP_STEP = 0.03
STEP_TIMEOUT = 0.5  #: Time after a step of the wall clock in which stamps may step, too (s).


class ClockStepMonitor:
    """Detects poses between whose stamps the wall clock was set: they give no velocity."""

    def __init__(self) -> None:
        self._offset = math.inf
        self._stepped_at = -math.inf
        self._stamp = self._time = 0.0

    def update(self, stamp: float, time: float, wall_clock: Callable[[float], int]) -> bool:
        """Return whether the clock was set between the last pose and this one.

        ``stamp`` is that of the pose, s; ``time`` is now by a clock that is never set, s, for which
        ``wall_clock(time)`` returns wall-clock time, ns.
        """
        step = (stamp - self._stamp) - (time - self._time)
        self._stamp, self._time = stamp, time
        if abs(step) <= STAMP_STEP:
            return False
        # The pose may also have been delayed.
        offset = wall_clock(time) * 1e-9 - time
        if abs(offset - self._offset) > STAMP_STEP:
            self._stepped_at = time
        self._offset = offset
        return time - self._stepped_at < STEP_TIMEOUT


class MotionEstimator:
    """Motion from a sequence of poses, by the poses' own stamps.

    A pose whose stamp repeats, or that is not finite, is ignored. A pose whose stamp goes
    back is the first of a new sequence: tf returns the latest pose, so its stamp goes back only
    when time does.

    The angle filter is given unwrapped roll, pitch and yaw, for their rates. The angles are passed
    on as they are: smoothing would cost the yaw loop its phase.
    """

    def __init__(self, position_filter: RateFilter, angle_filter: RateFilter):
        self._position_filter = position_filter
        self._angle_filter = angle_filter
        self._angles: Components = (0.0, 0.0, 0.0)
        self.reset()

    def reset(self) -> None:
        """Delete the estimate: the next pose is the first."""
        self._stamp: int | None = None
        # The last motion and the one before it, with their stamps (ns).
        self._last: tuple[int, EstimatedMotion] | None = None
        self._before: tuple[int, EstimatedMotion] | None = None

    def update(
        self,
        stamp: int,
        position: Components,
        attitude: Components,
        acceleration: Components | None = None,
    ) -> EstimatedMotion | None:
        """Process the next pose; return the motion, or None if the pose is the first or ignored.

        The stamp is in ns, since floats resolve the time of day to 0.2 us only; the position in m;
        the attitude roll, pitch, yaw in rad; ``acceleration`` was commanded since the last pose, if
        it is known, m/s^2.
        """
        if not math.isfinite(sum(position) + sum(attitude)):
            return None
        if self._stamp is None or stamp < self._stamp:
            self._start(stamp, position, attitude)
            return None
        if stamp == self._stamp:
            return None
        motion = self._step((stamp - self._stamp) * 1e-9, position, attitude, acceleration)
        self._stamp = stamp
        if not math.isfinite(sum(map(sum, motion))):
            self.reset()
            return None
        self._before, self._last = self._last, (stamp, motion)
        return motion

    def without_last(self, stamp: int, acceleration: Components) -> EstimatedMotion | None:
        """Return the motion at ``stamp`` (ns) as it follows from the last pose but one, or None.

        For a source of poses that has frozen: its last pose is older than its stamp says, and made
        the vehicle slower. The ``acceleration`` was commanded since then, m/s^2.
        """
        if self._before is None:
            return None
        begin, motion = self._before
        dt = 1e-9 * (stamp - begin)
        axes = list(zip(motion.position, motion.velocity, acceleration, strict=True))
        return motion._replace(
            position=[p + dt * v + 0.5 * dt * dt * a for p, v, a in axes],
            velocity=[v + dt * a for _, v, a in axes],
        )

    def _step(self, dt, position, attitude, acceleration):
        self._angles = [
            angle + wrap_to_pi(new - angle)
            for angle, new in zip(self._angles, attitude, strict=True)
        ]
        position, velocity = self._position_filter.step(dt, position, acceleration)
        _, attitude_rate = self._angle_filter.step(dt, self._angles)
        return EstimatedMotion(
            position, velocity, [wrap_to_pi(each) for each in attitude], attitude_rate
        )

    def _start(self, stamp, position, attitude):
        self.reset()
        self._stamp = stamp
        self._angles = attitude
        self._position_filter.start(position)
        self._angle_filter.start(attitude)
