"""The state estimator, and its external measurements.

Position and velocity: a Kalman filter per axis, predicted with the
accelerometer and corrected with measured positions; the axes have one
covariance. Attitude: the gyroscope's integral, corrected with measured
attitudes in proportion to its variance, and, on the ground, pulled
towards the initial attitude.

The client sends positions or poses, as real vehicles get them from a motion
capture system. In their absence a positioning deck measures the true pose;
without a deck the estimate is dead reckoning.

Between two predictions, 100 times a second, the estimate is constant, as the
firmware's is (estimator_kalman.c, PREDICT_RATE). To the attitude controller,
500 times a second, its rate of change is a pulse in one step of five, and in fast
turns the limit of the outputs cuts off these pulses: the damping of a large
step of the yaw is lost, and it overshoots.
"""

import math

from crazyflie_model.angles import Quaternion, Triple, rotate, turned, zyx_from_quaternion
from crazyflie_model.units import GRAVITY
from crazyflie_virtual.body import Sensors
from crazyflie_virtual.firmware.states import Estimate

COMPLEMENTARY, KALMAN = 1, 2  #: Numbers of the firmware's estimators.
_BAROMETER_TIME = 1.0  #: Time constant of the height by the barometer, s: assumed.

_ACCELERATION_NOISE = 3.7e-4  #: Process noise, m^2/s^3: 0.6 m/s^2, held for 1 ms each.
_RATE_NOISE = 1e-5  #: Process noise, rad^2/s: 0.1 rad/s, held for 1 ms each.
#: Limit for position and velocity (m^2, m^2/s^2): MAX_COVARIANCE of kalman_core.c.
_MOST_VARIANCE = 100.0
#: Variance of the position, covariance, variance of the velocity (m^2, m^2/s, m^2/s^2).
_FIRST_VARIANCES = (_MOST_VARIANCE, 0.0, 1.0)
#: Initial variance of the attitude (rad^2): the first measurement has full weight.
_FIRST_ATTITUDE_VARIANCE = 10.0
_LEAST_VARIANCE = 1e-12  #: Limit for measurements (m^2, rad^2): clients may set a deviation of 0.
#: Time constant with which the attitude returns to the initial one at rest, s.
_REVERSION_TIME = 10.0


class Estimator:
    """Estimate of position, velocity and attitude, updated in place.

    The complementary filter has no position: x and y are 0, z is the barometer's, and external
    measurements are ignored. A vehicle without decks begins with it.
    """

    def __init__(self, estimate: Estimate, kind: int = KALMAN):
        self._kind = kind
        self._pressure_height = 0.0
        #: The estimate; others read it.
        self.estimate = self._estimate = estimate
        #: Pose after `reset`, m and rad.
        self.initial_x = self.initial_y = self.initial_z = self.initial_yaw = 0.0
        self.reset()

    def reset(self) -> None:
        """Return to the initial pose, at rest, with the initial variances."""
        e = self._estimate
        e.x, e.y, e.z = self.initial_x, self.initial_y, self.initial_z
        if self._kind == COMPLEMENTARY:
            e.x, e.y, e.z = 0.0, 0.0, self._pressure_height
        e.vx = e.vy = e.vz = e.ax = e.ay = e.az = 0.0
        e.qx = e.qy = 0.0
        e.qz, e.qw = math.sin(self.initial_yaw / 2.0), math.cos(self.initial_yaw / 2.0)
        self._covariance = _FIRST_VARIANCES
        self.variance_attitude = _FIRST_ATTITUDE_VARIANCE
        self._samples: list[tuple[float, ...]] = []
        self._update_angles()

    @property
    def kind(self) -> int:
        """`COMPLEMENTARY` or `KALMAN`; another one starts from its reset."""
        return self._kind

    @kind.setter
    def kind(self, kind: int) -> None:
        if kind != self._kind:
            self._kind = kind
            self.reset()

    @property
    def variance_position(self) -> float:
        """Variance of the position along each axis, m^2."""
        return self._covariance[0]

    @property
    def variance_velocity(self) -> float:
        """Variance of the velocity along each axis, m^2/s^2."""
        return self._covariance[2]

    def sample(self, sensors: Sensors) -> None:
        """Add a sample of the inertial sensors for the next `predict`."""
        s = sensors
        self._pressure_height = s.asl
        self._samples.append((s.gyro_x, s.gyro_y, s.gyro_z, s.acc_x, s.acc_y, s.acc_z))

    def predict(self, dt: float) -> None:
        """Predict by ``dt`` (s) with the mean of its samples."""
        mean = [sum(parts) / len(parts) for parts in zip(*self._samples, strict=True)]
        self._samples = []
        e = self._estimate
        rotation = [dt * math.radians(rate) for rate in mean[:3]]
        e.qx, e.qy, e.qz, e.qw = turned(e.quaternion, rotation)
        e.ax, e.ay, up = rotate(e.quaternion, mean[3:])
        e.az = up - 1.0
        if self._kind == COMPLEMENTARY:
            e.vz = (self._pressure_height - e.z) / _BAROMETER_TIME
            e.z += dt * e.vz
            self._update_angles()
            return
        dvx, dvy, dvz = GRAVITY * dt * e.ax, GRAVITY * dt * e.ay, GRAVITY * dt * e.az
        e.x += dt * (e.vx + 0.5 * dvx)
        e.y += dt * (e.vy + 0.5 * dvy)
        e.z += dt * (e.vz + 0.5 * dvz)
        e.vx += dvx
        e.vy += dvy
        e.vz += dvz
        self._update_angles()

    def grow_variances(self, dt: float) -> None:
        """Add the process noise of ``dt`` (s) to the variances."""
        p, m, v = self._covariance
        q = _ACCELERATION_NOISE
        p += 2.0 * dt * m + dt * dt * v + q * dt**3 / 3.0
        m += dt * v + q * dt * dt / 2.0
        # As in the firmware, the variance grows as long as nothing is measured.
        v = min(v + q * dt, _MOST_VARIANCE)
        if p > _MOST_VARIANCE:
            p, m = _MOST_VARIANCE, 0.0
        self._covariance = (p, m, v)
        self.variance_attitude = min(
            self.variance_attitude + _RATE_NOISE * dt, _FIRST_ATTITUDE_VARIANCE
        )

    def correct_position(self, x: float, y: float, z: float, deviation: float) -> None:
        """Correct with a measured position (m) of a standard deviation (m)."""
        if self._kind == COMPLEMENTARY:
            return
        e = self._estimate
        p, m, v = self._covariance
        total = p + max(deviation * deviation, _LEAST_VARIANCE)
        gain_p, gain_v = p / total, m / total
        dx, dy, dz = x - e.x, y - e.y, z - e.z
        e.x += gain_p * dx
        e.y += gain_p * dy
        e.z += gain_p * dz
        e.vx += gain_v * dx
        e.vy += gain_v * dy
        e.vz += gain_v * dz
        self._covariance = ((1.0 - gain_p) * p, (1.0 - gain_p) * m, v - gain_v * m)

    def correct_attitude(self, x: float, y: float, z: float, w: float, deviation: float) -> None:
        """Correct with a measured attitude, a unit quaternion, of a deviation (rad)."""
        if self._kind == COMPLEMENTARY:
            return
        variance = max(deviation * deviation, _LEAST_VARIANCE)
        gain = self.variance_attitude / (self.variance_attitude + variance)
        self._blend(x, y, z, w, gain)
        self.variance_attitude *= 1.0 - gain

    def correct_on_ground(self, dt: float) -> None:
        """Correct towards the initial attitude, near which a vehicle on the ground is."""
        z, w = math.sin(self.initial_yaw / 2.0), math.cos(self.initial_yaw / 2.0)
        self._blend(0.0, 0.0, z, w, dt / _REVERSION_TIME)

    def _blend(self, x, y, z, w, gain):
        # Towards another quaternion; for small angles a straight line approximates the great
        # circle.
        e = self._estimate
        if e.qx * x + e.qy * y + e.qz * z + e.qw * w < 0.0:
            x, y, z, w = -x, -y, -z, -w
        parts = [a + gain * (b - a) for a, b in zip(e.quaternion, (x, y, z, w), strict=True)]
        norm = math.hypot(*parts)
        e.qx, e.qy, e.qz, e.qw = (part / norm for part in parts)
        self._update_angles()

    def _update_angles(self):
        e = self._estimate
        roll, pitch, yaw = zyx_from_quaternion(e.quaternion)
        e.roll, e.pitch, e.yaw = math.degrees(roll), -math.degrees(pitch), math.degrees(yaw)


EXTERNAL_AGE = 0.5  #: Time without an external measurement after which the deck measures (s).


class Localization:
    """Corrects the estimator by external measurements."""

    def __init__(self, estimator: Estimator):
        self._estimator = estimator
        #: x, y, z, qx, qy, qz, qw: Last external measurement, m; for the log.
        self.x = self.y = self.z = 0.0
        self.qx = self.qy = self.qz = 0.0
        self.qw = 1.0
        self.time: float | None = None  #: Time of its arrival (s).
        #: position_deviation, attitude_deviation: Standard deviations that external measurements
        #: are taken to have, m and rad.
        self.position_deviation = 0.01
        self.attitude_deviation = 0.0045

    @property
    def milliseconds(self) -> float:
        """Arrival of the last external measurement, ms, in the 16 bits of the log."""
        return 0.0 if self.time is None else 1000.0 * self.time % 65536.0

    def take_position(self, time: float, position: Triple) -> None:
        """Process an external position (m)."""
        self.time = time
        self.x, self.y, self.z = position
        self._estimator.correct_position(*position, self.position_deviation)

    def take_pose(self, time: float, position: Triple, quaternion: Quaternion) -> None:
        """Process an external position (m) and attitude, a unit quaternion (x, y, z, w)."""
        self.take_position(time, position)
        self.qx, self.qy, self.qz, self.qw = quaternion
        self._estimator.correct_attitude(*quaternion, self.attitude_deviation)

    def is_fed(self, time: float) -> bool:
        """Return whether an external measurement is recent at ``time`` (s)."""
        return self.time is not None and time - self.time < EXTERNAL_AGE
