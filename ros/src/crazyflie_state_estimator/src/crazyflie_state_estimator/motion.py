"""The motion of a vehicle from its stamped poses."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crazyflie_model.angles import wrap_to_pi
from crazyflie_state_estimator.rate_filter import RateFilter


class Motion(NamedTuple):
    """Where a vehicle is and how it moves, in the fixed frame.

    Attributes
    ----------
    position : ndarray, shape (3,)
        x, y, z in m.
    velocity : ndarray, shape (3,)
        m/s.
    attitude : ndarray, shape (3,)
        Roll, pitch, yaw in rad, in [-pi, pi]; see `crazyflie_model.angles`.
    attitude_rate : ndarray, shape (3,)
        Time derivatives of roll, pitch, yaw in rad/s (not the body's angular
        velocity).
    """

    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    attitude: NDArray[np.float64]
    attitude_rate: NDArray[np.float64]


class MotionEstimator:
    """Motion from a sequence of poses, by the poses' own stamps.

    A pose whose stamp repeats is ignored, and so is one that is not finite. One
    whose stamp goes back is the first of a new sequence: tf hands out the latest
    pose, so its stamp goes back only when time does.

    Parameters
    ----------
    position_filter : RateFilter
        What turns positions into positions and velocities.
    angle_filter : RateFilter
        What turns roll, pitch and yaw (unwrapped: without jumps by 2 pi) into
        their rates. The angles themselves are passed on as they are: their noise
        is small beside what a controller does with them, and smoothing would
        cost the yaw loop its phase.
    """

    def __init__(self, position_filter: RateFilter, angle_filter: RateFilter):
        self._position_filter = position_filter
        self._angle_filter = angle_filter
        self._stamp: int | None = None
        self._angles = np.zeros(3)

    def reset(self) -> None:
        """Forget everything: the next pose is the first."""
        self._stamp = None

    def update(
        self,
        stamp: int,
        position: ArrayLike,
        attitude: ArrayLike,
        acceleration: NDArray[np.float64] | None = None,
    ) -> Motion | None:
        """Take the next pose and return the motion at its time.

        Parameters
        ----------
        stamp : int
            Time of the pose, ns. Whole nanoseconds, because a float cannot tell
            times of the day apart by less than 0.2 us.
        position : array_like, shape (3,)
            m.
        attitude : array_like, shape (3,)
            Roll, pitch, yaw in rad.
        acceleration : ndarray, shape (3,), optional
            Commanded since the last pose, if it is known, m/s^2.

        Returns
        -------
        Motion or None
            None when the pose is the first or ignored.
        """
        position = np.asarray(position, dtype=float)
        attitude = np.asarray(attitude, dtype=float)
        if not (np.isfinite(position).all() and np.isfinite(attitude).all()):
            return None
        if self._stamp is None or stamp < self._stamp:
            self._start(stamp, position, attitude)
            return None
        if stamp == self._stamp:
            return None
        with np.errstate(over="ignore", invalid="ignore"):
            motion = self._step((stamp - self._stamp) * 1e-9, position, attitude, acceleration)
        self._stamp = stamp
        if not all(np.isfinite(part).all() for part in motion):
            self.reset()
            return None
        return motion

    def _step(self, dt, position, attitude, acceleration):
        self._angles = self._angles + wrap_to_pi(attitude - self._angles)
        position, velocity = self._position_filter.step(dt, position, acceleration)
        _, attitude_rate = self._angle_filter.step(dt, self._angles)
        return Motion(position, velocity, np.asarray(wrap_to_pi(attitude)), attitude_rate)

    def _start(self, stamp, position, attitude):
        self._stamp = stamp
        self._angles = attitude
        self._position_filter.start(position)
        self._angle_filter.start(attitude)
