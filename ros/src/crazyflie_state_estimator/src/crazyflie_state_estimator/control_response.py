"""The motion that a control causes, and whether the poses of a vehicle follow it.

One Kalman filter has the state (p, v, d) of a vehicle in flight along each axis:

    p'' = a(u) + d

with the acceleration a that the control commands, `LAG` later, and a disturbance d of weight,
battery and wind. It is given the means of blocks of poses. From its estimate at t0 the vehicle is
at

    p(t) = p0 + v0 T + d0 T^2 / 2 + integral of integral of a,    T = t - t0,

with the variance, along each axis,

    s^2 = f P f' + min(q^2 T^5 / 20, (D T^2 / 2)^2) + L^2 |integral of a - a(t0)|^2 + n^2,

where f = (1, T, T^2 / 2), P is the covariance of the estimate, q the random walk of the
disturbance (`DISTURBANCE_WALK`), D its limit (`DISTURBANCE_CHANGE`), L the uncertainty of the
vehicle's delay (`LAG_ERROR`) and n the error of a measured place. Poses that stay at one place to
within their noise although p(t) is more than a threshold times s away from it do not respond to the
control. A vehicle in gusts departs from p(t), too, but does not stay at one place meanwhile.
"""

import math
from collections import deque
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
        self._response: list[float] | None = None
        self._answered = 0.0

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

    def response(self, acceleration: list[float] | None, time: float) -> list[float] | None:
        """Return the acceleration (3,), m/s^2, with which a vehicle answers at ``time`` (s).

        It follows that of the control, `acceleration`, with the time constant `LAG`.
        """
        dt, self._answered = time - self._answered, time
        if acceleration is None or self._response is None or not 0.0 <= dt <= HOLD_LIMIT:
            self._response = acceleration
        else:
            share = 1.0 - math.exp(-dt / LAG)
            self._response = [
                old + share * (new - old)
                for old, new in zip(self._response, acceleration, strict=True)
            ]
        return self._response


#: Least duration (s) and number of poses over which poses and controls are averaged.
BLOCK, BLOCK_POSES = 0.05, 4
MAX_GAP = 0.25  #: Pause between two poses after which the estimate restarts (s).
DISTURBANCE_WALK = 0.25  #: Random walk of the disturbance (m/s^2/sqrt(s)).

#: Standard deviations of the velocity (m/s) and of the disturbance (m/s^2) after the liftoff: mass
#: and thrust of a vehicle may be wrong by 15 %.
FIRST_SPEED, FIRST_DISTURBANCE = 1.0, 1.5
KNOWN = 0.5  #: Standard deviation of a disturbance that is known (m/s^2).

#: Largest change of the disturbance of a vehicle that stays at one place (m/s^2).
DISTURBANCE_CHANGE = 0.05

#: Time constant of the vehicle's response (motors, attitude, latency of the poses) and its standard
#: deviation (s).
LAG, LAG_ERROR = 0.1, 0.04

#: Least time T of a prediction (s), and threshold of its distance (standard deviations). In 570
#: healthy flights, with gusts of up to 1 m/s and noise of up to 3 mm, the worst reached 0.8 of a
#: threshold.
THRESHOLDS = ((0.8, 3.6), (0.35, 5.5))

#: Time from the beginning of a stay in which estimates still contain the motion before it (s).
SETTLING = 0.5
WINDOW, ESTIMATE_PERIOD = 3.0, 0.25  #: Time for which estimates are kept, and their period (s).

#: Poses stay at a place while the mean of a block differs from that of the stay by less than the
#: first value (m), or by less than the second one (standard deviations of the difference).
TOLERANCE, TOLERANCE_FACTOR = 0.0003, 4.0

#: Least noise of a pose, and error of the prediction at T = 0 (m).
MIN_NOISE, PLACE_ERROR = 1e-4, 0.003
NOISE_AVERAGING = 40.0  #: Number of blocks over which the variance of the noise is averaged.

Vector = Sequence[float]


class Departure(NamedTuple):
    """Predicted position (m) and velocity (m/s) of a vehicle whose poses do not show it."""

    position: Vector
    velocity: Vector


class _Estimate(NamedTuple):
    """The Kalman filter's estimate, and the integrals of the commanded acceleration until then."""

    time: float
    position: Vector
    velocity: Vector
    disturbance: Vector
    covariance: list[list[float]]
    commanded: Vector
    speed: Vector
    way: Vector


class _Stay(NamedTuple):
    begin: float
    mean: Vector
    poses: int


class ResponseMonitor:
    """Compares the poses of a vehicle in flight with the motion that its control causes."""

    def __init__(self) -> None:
        self._noise = 1e-3
        self._filter = ConstantAccelerationFilter(
            self._noise, DISTURBANCE_WALK, FIRST_SPEED, FIRST_DISTURBANCE
        )
        self.reset()

    def reset(self) -> None:
        """Restart with the next pose; keep the noise of the poses."""
        self._block: list[tuple[float, Vector, Vector]] = []
        self._time: float | None = None
        self._commanded: Vector = ()
        self._speed: Vector = (0.0, 0.0, 0.0)
        self._way: Vector = (0.0, 0.0, 0.0)
        self._estimates: deque[_Estimate] = deque()
        self._latest: deque[_Estimate] = deque(maxlen=2)
        self._before: _Estimate | None = None
        self._stay: _Stay | None = None

    @property
    def disturbance(self) -> Vector | None:
        """What weight, battery and wind add to the acceleration (m/s^2); None while unknown."""
        if not self._latest or self._latest[-1].covariance[2][2] > KNOWN**2:
            return None
        return self._latest[-1].disturbance

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
        self._estimate(middle, mean, _mean(accelerations), len(block))
        self._update_noise([each - middle for each in times], positions, mean)
        self._update_stay(middle, mean, len(block))
        return self._departure(middle)

    def predict(self, time: float, acceleration: Vector, last: tuple[float, Vector]) -> Vector:
        """Return the position to which the control has led the vehicle, without a pose, m.

        ``last`` are time (s) and position of the last pose: the vehicle is taken to have been at
        rest there, if its motion was not observed before.
        """
        if not self._latest or self._time is None or time - self._time > MAX_GAP:
            self.reset()
            begin = max(last[0], time - MAX_GAP)
            self._start(begin, last[1], acceleration)
            self._remember(begin)
        self._block = []
        self._advance(time, acceleration)
        start = self._latest[-1]
        # The weight stays. The rest may be drag, which does not last as long as outliers may.
        start = start._replace(disturbance=(0.0, 0.0, start.disturbance[2]))
        return self._offset(time - start.time, start, (0.0, 0.0, 0.0))

    def _start(self, time, position, acceleration):
        self._time, self._commanded = time, acceleration
        self._filter.start(position, acceleration)

    def _advance(self, time, acceleration):
        """Integrate the lagged acceleration that the control commands."""
        dt, self._time = time - self._time, time
        share = 1.0 - math.exp(-dt / LAG)
        self._commanded = [
            old + share * (new - old)
            for old, new in zip(self._commanded, acceleration, strict=True)
        ]
        self._way = [
            way + dt * speed + 0.5 * dt * dt * a
            for way, speed, a in zip(self._way, self._speed, self._commanded, strict=True)
        ]
        self._speed = [v + dt * a for v, a in zip(self._speed, self._commanded, strict=True)]

    def _remember(self, time):
        total, commanded = self._filter.acceleration, self._commanded
        estimate = _Estimate(
            time,
            self._filter.value,
            self._filter.rate,
            [a - b for a, b in zip(total, commanded, strict=True)],
            self._filter.covariance,
            commanded,
            self._speed,
            self._way,
        )
        self._latest.append(estimate)

    def _estimate(self, time, position, acceleration, count):
        self._filter.tune(self._noise / math.sqrt(count), DISTURBANCE_WALK)
        if self._time is None:
            self._start(time, position, acceleration)
            return
        dt = time - (self._latest[-1].time if self._latest else self._time)
        self._advance(time, acceleration)
        if dt > 2.0 * MAX_GAP:
            # So long without a pose, the control may have changed several times.
            self._filter.start(position, self._commanded)
            self._estimates.clear()
        else:
            self._filter.step(dt, position, self._commanded)
        self._remember(time)
        while self._estimates and time - self._estimates[0].time > WINDOW:
            self._estimates.popleft()
        if not self._estimates or time - self._estimates[-1].time >= ESTIMATE_PERIOD:
            self._estimates.append(self._latest[-1])

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

    def _update_stay(self, time, mean, count):
        if self._stay is not None:
            begin, place, total = self._stay
            deviation = self._noise * math.sqrt(1.0 / count + 1.0 / total)
            if math.dist(mean, place) < TOLERANCE + TOLERANCE_FACTOR * deviation:
                share = count / (total + count)
                place = [a + share * (b - a) for a, b in zip(place, mean, strict=True)]
                self._stay = _Stay(begin, place, total + count)
                return
        self._stay = _Stay(time, mean, count)
        self._before = self._latest[0] if self._latest else None

    def _departure(self, time):
        if self._stay is None:
            return None
        place, settled = self._stay.mean, self._stay.begin + SETTLING
        estimates = [each for each in self._estimates if each.time > settled]
        if self._before is not None and time - self._before.time < 2.0 * WINDOW:
            estimates.insert(0, self._before)
        tolerated = min(limit for _, limit in THRESHOLDS) * self._place_error
        best, most = None, 1.0
        for start in estimates:
            duration = time - start.time
            offset = self._offset(duration, start, place)
            # In an undisturbed flight nearly all predictions end nearer than that.
            if math.hypot(*offset) > tolerated:
                deviation = self._deviation(duration, start)
                significance = _significance(duration, offset, deviation)
                if significance > most:
                    best, most = (start, offset), significance
        return None if best is None else self._predicted(time - best[0].time, *best, place)

    @property
    def _place_error(self):
        return PLACE_ERROR + TOLERANCE_FACTOR * self._noise / math.sqrt(BLOCK_POSES)

    def _offset(self, t, start, place):
        """Return the position predicted by an estimate after ``t`` (s) minus the stay's (m)."""
        x, y, z = place
        (px, py, pz), (vx, vy, vz), (dx, dy, dz) = start.position, start.velocity, start.disturbance
        (wx, wy, wz), (ux, uy, uz), (sx, sy, sz) = self._way, start.way, start.speed
        return (
            px + (vx + 0.5 * dx * t) * t + (wx - ux - sx * t) - x,
            py + (vy + 0.5 * dy * t) * t + (wy - uy - sy * t) - y,
            pz + (vz + 0.5 * dz * t) * t + (wz - uz - sz * t) - z,
        )

    def _deviation(self, t, start):
        """Return the standard deviation of such an offset (m)."""
        (p00, p01, p02), (_, p11, p12), (_, _, p22) = start.covariance
        variance = p00 + t * (2.0 * p01 + t * (p11 + p02 + t * (p12 + 0.25 * t * p22)))
        variance += min(DISTURBANCE_WALK**2 * t / 5.0, DISTURBANCE_CHANGE**2) * t**4 / 4.0
        changes = (
            end - begin - a * t
            for begin, end, a in zip(start.speed, self._speed, start.commanded, strict=True)
        )
        variance += LAG_ERROR**2 * sum(each * each for each in changes)
        return math.sqrt(variance + self._place_error**2)

    def _predicted(self, t, start, offset, place):
        position = [a + b for a, b in zip(place, offset, strict=True)]
        velocity = [
            v + disturbance * t + end - begin
            for v, disturbance, begin, end in zip(
                start.velocity, start.disturbance, start.speed, self._speed, strict=True
            )
        ]
        return Departure(position, velocity)


def _significance(duration: float, offset: Vector, deviation: float) -> float:
    """Return the distance of a prediction from the stay, over the largest that is tolerated."""
    threshold = next((limit for least, limit in THRESHOLDS if duration >= least), math.inf)
    x, y, z = offset
    # A vehicle that is to sink may be on an object, and friction (coefficient 1) may hold it.
    distance = math.hypot(x, y, z) if z >= 0.0 else max(math.hypot(x, y) + z, 0.0)
    return distance / (threshold * deviation)


def _mean(vectors: Sequence[Vector]) -> list[float]:
    return [sum(column) / len(vectors) for column in zip(*vectors, strict=True)]
