"""The motion of a vehicle from its stamped poses."""

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
        self._stamp: int | None = None
        self._angles: Components = (0.0, 0.0, 0.0)

    def reset(self) -> None:
        """Delete the estimate: the next pose is the first."""
        self._stamp = None

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
        return motion

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
        self._stamp = stamp
        self._angles = attitude
        self._position_filter.start(position)
        self._angle_filter.start(attitude)
