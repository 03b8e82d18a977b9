"""The motion that a control causes, and whether the poses of a vehicle follow it.

One Kalman filter has the state (p, v, d) of a vehicle in flight along each axis:

    p'' = a(u) + d

with the acceleration a that the control commands, `LAG` later, and a disturbance d of weight,
battery and wind. It is given the means of blocks of poses. The delay is known
to within `LAG_ERROR` L, so a change of a by Delta adds (L Delta)^2 to the variance of v. Blocks
whose innovation is improbable do not correct the filter while they stay at one place to within
their noise. They do not follow the control once that place is more than a threshold times s from
the predicted one,

    s^2 = P_pp + n^2

with the filter's covariance P and the error n of a measured place. A vehicle in gusts departs from
the prediction, too, but does not stay at one place meanwhile.
"""

import math
from collections.abc import Sequence
from operator import mul
from typing import NamedTuple

from crazyflie_model.dynamics import coupled_acceleration
from crazyflie_model.limits import HOLD_LIMIT, MAX_THRUST, MIN_THRUST
from crazyflie_state_estimator.motion import ConstantAccelerationFilter


class ControlInput:
    """The last control, while it is informative about the motion."""

    def __init__(self) -> None:
        self._control: Sequence[float] | None = None
        self._time = 0.0

    def command(self, control: Sequence[float], time: float) -> None:
        """Set the control (roll, pitch, yaw rate, thrust; rad, rad/s, m/s^2) at ``time`` (s)."""
        self._control = control
        self._time = time

    def acceleration(self, yaw: float, time: float) -> list[float] | None:
        """Return the acceleration (3,), m/s^2, at a yaw (rad) and time (s).

        None without a control, when it is older than `HOLD_LIMIT`, and when its thrust is less than
        that of flight.
        """
        if self._control is None or not 0.0 <= time - self._time <= HOLD_LIMIT:
            return None
        roll, pitch, yaw_dot, thrust = self._control
        if thrust < MIN_THRUST:
            return None
        thrust = min(thrust, MAX_THRUST)
        return coupled_acceleration((roll, pitch, yaw_dot, thrust), yaw)


#: Least duration (s) and number of poses over which poses and controls are averaged.
BLOCK, BLOCK_POSES = 0.05, 4
MAX_GAP = 0.25  #: Pause between two poses after which the filter restarts (s).
DISTURBANCE_WALK = 0.2  #: Random walk of the disturbance (m/s^2/sqrt(s)).

#: Standard deviations of the velocity (m/s) and of the disturbance (m/s^2) after the liftoff: mass
#: and thrust of a vehicle may be wrong by 15 %.
FIRST_SPEED, FIRST_DISTURBANCE = 1.0, 1.5
KNOWN = 0.5  #: Standard deviation of a disturbance that is known (m/s^2).

#: Time constant of the vehicle's response (motors, attitude, latency of the poses) and its standard
#: deviation (s).
LAG, LAG_ERROR = 0.1, 0.04

#: Innovation of a block that is improbable (standard deviations).
SUSPICIOUS = 2.0

#: Least time T of a prediction (s), and threshold of its distance (standard deviations).
THRESHOLDS = ((0.8, 3.4), (0.35, 4.8))

#: A prediction ends with poses that are nearer to it than this part of the threshold, and after
#: this time (s): the disturbance may have changed.
CONFIRMED, MAX_PREDICTION = 0.5, 3.0
CARRIED = 2.0  #: Distance at which a vehicle that is to sink is on an object (thresholds).

#: Poses stay at a place while the mean of a block differs from that of the stay by less than the
#: first value (m), or by less than the second one (standard deviations of the difference).
TOLERANCE, TOLERANCE_FACTOR = 0.0003, 4.0

FIRST_NOISE = 1e-3  #: Noise of a pose before it has been measured (m).
#: Least noise of a pose, and error of the prediction at T = 0 (m).
MIN_NOISE, PLACE_ERROR = 1e-4, 0.004
NOISE_AVERAGING = 40.0  #: Number of blocks over which the variance of the noise is averaged.

Vector = Sequence[float]


class Departure(NamedTuple):
    """Predicted position (m) and velocity (m/s) of a vehicle whose poses do not show it."""

    position: Vector
    velocity: Vector


class _Stay(NamedTuple):
    """Poses at one place, against which the filter predicts."""

    begin: float  #: Time of the last correction (s).
    place: Vector
    poses: int


class ResponseMonitor:
    """Compares the poses of a vehicle in flight with the motion that its control causes."""

    def __init__(self) -> None:
        self._noise = FIRST_NOISE
        self._filter = ConstantAccelerationFilter(
            self._noise, DISTURBANCE_WALK, FIRST_SPEED, FIRST_DISTURBANCE
        )
        self.reset()

    def reset(self) -> None:
        """Restart with the next pose; keep the noise of the poses."""
        self._block: list[tuple[float, Vector, Vector]] = []
        self._time: float | None = None
        self._commanded: Vector = ()
        self._stay: _Stay | None = None

    @property
    def disturbance(self) -> Vector | None:
        """What weight, battery and wind add to the acceleration (m/s^2); None while unknown."""
        if self._time is None or self._filter.covariance[2][2] > KNOWN**2:
            return None
        total = self._filter.acceleration
        return [a - b for a, b in zip(total, self._commanded, strict=True)]

    def update(self, time: float, position: Vector, acceleration: Vector) -> Departure | None:
        """Process a pose; return where the vehicle is if the poses do not respond to the control.

        ``time`` is the pose's stamp, s; position, m, and commanded acceleration, m/s^2, are in the
        fixed frame.
        """
        last = self._block[-1][0] if self._block else self._time
        if last is not None and not 0.0 < time - last < MAX_GAP:
            self.reset()
        self._block.append((time, position, acceleration))
        if time - self._block[0][0] < BLOCK or len(self._block) <= BLOCK_POSES:
            return None
        # The last pose of a block is the first of the next one.
        block, self._block = self._block[:-1], self._block[-1:]
        times, positions, accelerations = zip(*block, strict=True)
        middle = sum(times) / len(times)
        mean = _mean(positions)
        # What holds a vehicle that stays at one place does not change.
        walk = DISTURBANCE_WALK if self._stay is None else 0.0
        self._filter.tune(self._noise / math.sqrt(len(block)), walk)
        departure = self._compare(middle, mean, _mean(accelerations), len(block))
        self._update_noise([each - middle for each in times], positions, mean)
        return departure

    def predict(self, time: float, acceleration: Vector, last: tuple[float, Vector]) -> Vector:
        """Return the position to which the control has led the vehicle, without a pose, m.

        ``last`` are time (s) and position of the last pose: the vehicle is taken to have been at
        rest there, if its motion was not observed before.
        """
        if self._time is None or time - self._time > MAX_GAP:
            self._start(*last, acceleration)
        self._block = []
        self._advance(time, acceleration)
        return self._filter.value

    def _start(self, time, position, acceleration):
        self._time, self._commanded, self._stay = time, acceleration, None
        self._filter.start(position, acceleration)

    def _advance(self, time, acceleration):
        dt, self._time = min(time - self._time, MAX_GAP), time
        share = 1.0 - math.exp(-dt / LAG)
        change = [share * (b - a) for a, b in zip(self._commanded, acceleration, strict=True)]
        self._commanded = [a + b for a, b in zip(self._commanded, change, strict=True)]
        self._filter.predict(dt, self._commanded, LAG_ERROR**2 * sum(map(mul, change, change)))

    def _compare(self, time, mean, acceleration, count):
        """Predict to a block of poses; correct by it, unless it stays where the vehicle is not."""
        begin = self._time
        if begin is None:
            self._start(time, mean, acceleration)
            return None
        self._advance(time, acceleration)
        if self._stay is not None:
            self._stay = self._prolonged(self._stay, time, mean, count)
        elif math.dist(self._filter.value, mean) > SUSPICIOUS * self._filter.innovation_deviation:
            self._stay = _Stay(begin, mean, count)
        if self._stay is None:
            self._filter.correct(mean)
            return None
        duration = time - self._stay.begin
        if duration < THRESHOLDS[-1][0]:
            return None
        x, y, z = (a - b for a, b in zip(self._filter.value, self._stay.place, strict=True))
        distance, limit = math.hypot(x, y, z), self._limit(duration)
        is_carried = z < 0.0 and distance > CARRIED * limit
        if z < 0.0:
            # It is to sink: it may be on an object, and friction (coefficient 1) may hold it.
            distance = max(math.hypot(x, y) + z, 0.0)
        if distance > limit:
            return Departure(self._filter.value, self._filter.rate)
        if distance < CONFIRMED * limit:
            if is_carried:
                self._start(time, mean, acceleration)
            else:
                self._stay = None
                self._filter.correct(mean)
        return None

    def _prolonged(self, stay, time, mean, count):
        """Return the stay with another block; None if the block is not of it."""
        begin, place, poses = stay
        deviation = self._noise * math.sqrt(1.0 / count + 1.0 / poses)
        is_there = math.dist(mean, place) < TOLERANCE + TOLERANCE_FACTOR * deviation
        if not is_there or time - begin >= MAX_PREDICTION:
            return None
        share = count / (poses + count)
        place = [a + share * (b - a) for a, b in zip(place, mean, strict=True)]
        return _Stay(begin, place, poses + count)

    def _limit(self, duration):
        """Return the largest distance of the stay from the prediction that is tolerated (m)."""
        threshold = next(limit for least, limit in THRESHOLDS if duration >= least)
        place_error = PLACE_ERROR + TOLERANCE_FACTOR * self._noise / math.sqrt(BLOCK_POSES)
        return threshold * math.sqrt(self._filter.covariance[0][0] + place_error**2)

    def _update_noise(self, times, positions, mean):
        """Average the variance of the poses about a straight line through those of a block."""
        spread = sum(map(mul, times, times))
        squares = 0.0
        for axis, middle in enumerate(mean):
            offsets = [each[axis] - middle for each in positions]
            squares += sum(map(mul, offsets, offsets)) - sum(map(mul, times, offsets)) ** 2 / spread
        variance = max(squares, 0.0) / (3.0 * (len(times) - 2))
        variance = self._noise**2 + (variance - self._noise**2) / NOISE_AVERAGING
        self._noise = max(math.sqrt(variance), MIN_NOISE)


def _mean(vectors: Sequence[Vector]) -> list[float]:
    return [sum(column) / len(vectors) for column in zip(*vectors, strict=True)]
