"""The control law: a proportional and a derivative part, and feed-forward."""

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

GRAVITY = 9.81
"""m/s^2."""

MAX_TILT = 0.25
"""Of roll and pitch, rad."""

HOLD = 0.2
"""A reference whose velocity has not changed for so long does not accelerate, s."""

MAX_FEED_FORWARD = 3.0
"""On each axis, m/s^2; a jump of the velocity would ask for more."""

KP, KD, K_YAW = 0.0, 0.0, 0.0  # Step 4: choose them.
"""Gains: of the position, 1/s^2, of the velocity, 1/s, and of the yaw, 1/s."""


def acceleration(error: Vector, error_dot: Vector, feed_forward: Vector) -> Vector:
    """Return the acceleration that the vehicle should have, m/s^2, shape (3,), fixed frame.

    Parameters
    ----------
    error, error_dot : ndarray, shape (3,)
        Reference minus state: position, m, and velocity, m/s.
    feed_forward : ndarray, shape (3,)
        Acceleration of the reference, m/s^2.
    """
    raise NotImplementedError("step 1")


def attitude(wanted: Vector, yaw: float) -> tuple[float, float, float]:
    """Return roll and pitch (rad), within +- `MAX_TILT`, and thrust (m/s^2) for an acceleration.

    Small angles: in the heading frame (x ahead, y to the left) the vehicle accelerates by g pitch
    ahead and by g roll to the right; the thrust carries the weight and accelerates it upwards.

    Parameters
    ----------
    wanted : ndarray, shape (3,)
        Acceleration in the fixed frame, m/s^2.
    yaw : float
        Heading of the vehicle, rad, counter-clockwise.
    """
    raise NotImplementedError("step 2")


class FeedForward:
    """Finds the acceleration of a reference from its velocities."""

    def __init__(self):
        self._velocity: Vector | None = None
        self._time = 0.0
        self._acceleration = np.zeros(3)

    def acceleration(self, velocity: Vector, time: float) -> Vector:
        """Take the velocity (m/s, shape (3,)) of the reference at ``time`` (s).

        Return its change since the last different one, per second, within
        +- `MAX_FEED_FORWARD`; 0 at first, and when it has not changed for `HOLD`.
        """
        raise NotImplementedError("step 3")
