"""A box that a vehicle does not leave: least-restrictive control by stopping distance.

The criterion is the point where a vehicle would come to rest if it began to brake now. For each
axis, with position x and velocity v, this stopping point is

    X = x + v T + v |v| / (2 b)

for a reaction time T and a deceleration b. As long as X is in the box, x is
inside and can be kept inside. Its rate is X' = v + (T + |v| / b) a, so that the
acceleration a acts on it at once.

An inner box lies within the box, smaller by a margin on all sides. With e the
signed distance of X from the inner box, the fence asks for the acceleration

    a = -(v + r e) / (T + |v| / b),

which gives X' = -r e: the stopping point returns to the inner box exponentially,
at the rate r. Its weight s is 0 while X is in the inner box and rises smoothly with
|e| to 1 where X reaches the wall. Mixed with what the regular controller wants,

    X' = (1 - s) (v + (T + |v| / b) a_regular) - s r e,

which points inwards at the wall whatever the regular controller does. A regular
controller with limited acceleration that steers into the wall is stopped in the margin.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crazyflie_model.angles import rotate_by_yaw
from crazyflie_model.elementwise import clip
from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST
from crazyflie_model.units import GRAVITY

#: Largest horizontal acceleration that the fence asks for (m/s^2).
MAX_HORIZONTAL = GRAVITY * math.tan(MAX_TILT)
#: The share of an axis when both brake, in a corner of the box (m/s^2).
MAX_HORIZONTAL_BRAKING = MAX_HORIZONTAL / math.sqrt(2.0)
#: Acceleration by thrust that is possible upwards as well as downwards (m/s^2).
MAX_VERTICAL_BRAKING = min(GRAVITY - MIN_THRUST, MAX_THRUST - GRAVITY)

Vector = NDArray[np.float64]


class Geofence:
    """Prioritised controller that keeps a vehicle in a box.

    Parameters
    ----------
    lower, upper : array_like, shape (3,)
        Corners of the box, m, fixed frame.
    margin : float
        From the box to the inner box, m; upper - lower >= 2 margin.
    horizontal, vertical : tuple of float
        Reliable deceleration along x and y, and along z, m/s^2: at most `MAX_HORIZONTAL_BRAKING`
        and `MAX_VERTICAL_BRAKING`; and the time from a state until the vehicle decelerates because
        of it, s.
    recovery_rate : float
        At which the stopping point is brought back to the inner box, 1/s.
    """

    def __init__(
        self,
        lower: ArrayLike,
        upper: ArrayLike,
        margin: float,
        horizontal: tuple[float, float],
        vertical: tuple[float, float],
        recovery_rate: float,
    ):
        self._inner_lower = np.asarray(lower, dtype=float) + margin
        self._inner_upper = np.asarray(upper, dtype=float) - margin
        self._margin = margin
        axes = np.array([horizontal, horizontal, vertical])
        self._deceleration, self._reaction_time = axes.T
        self._recovery_rate = recovery_rate

    def stopping_point(self, position: Vector, velocity: Vector) -> Vector:
        """Return where the vehicle would come to rest, m, shape (3,)."""
        braking_time = np.abs(velocity) / self._deceleration
        return position + velocity * (self._reaction_time + braking_time / 2.0)

    def excess(self, position: Vector, velocity: Vector) -> Vector:
        """Return the signed distance of the stopping point from the inner box, m, shape (3,)."""
        stop = self.stopping_point(position, velocity)
        return stop - np.clip(stop, self._inner_lower, self._inner_upper)

    def weight(self, excess: Vector) -> Vector:
        """Return the weight of the fence's control on each axis, 0 ... 1, shape (3,)."""
        x = np.minimum(np.abs(excess) / self._margin, 1.0)
        return x * x * (3.0 - 2.0 * x)

    def acceleration(self, velocity: Vector, excess: Vector) -> Vector:
        """Return the acceleration (3,) that brings the stopping point back, m/s^2, fixed frame.

        Horizontally at most `MAX_HORIZONTAL`, in the right direction.
        """
        hold = self._reaction_time + np.abs(velocity) / self._deceleration
        wanted = -(velocity + self._recovery_rate * excess) / hold
        size = math.hypot(wanted[0], wanted[1])
        if size > MAX_HORIZONTAL:
            wanted[:2] *= MAX_HORIZONTAL / size
        return wanted

    def control(
        self, position: Vector, velocity: Vector, yaw: float, regular: Vector
    ) -> tuple[Vector, float]:
        """Return a control and the priority with which it is to be mixed with the regular one.

        The priority is the largest weight of the axes. On the others the fence's
        control is moved towards the regular one, so that the mixture gives each
        axis its own weight: a wall ahead does not keep the vehicle from moving along
        it, or from holding its height.

        Position and velocity have shape (3,), m and m/s, fixed frame; the yaw is in rad. Controls
        have shape (4,): roll and pitch (rad), yaw rate (rad/s), which is the regular one's, and
        thrust (m/s^2).
        """
        excess = self.excess(position, velocity)
        weight = self.weight(excess)
        priority = float(weight.max())
        share = weight / priority if priority > 0.0 else weight
        fence = self.acceleration(velocity, excess)
        wanted = acceleration_from_control(regular, yaw)
        return control_from_acceleration(
            share * fence + (1.0 - share) * wanted, yaw, regular[2]
        ), priority


def acceleration_from_control(control: Vector, yaw: float) -> Vector:
    """Return the acceleration, m/s^2, shape (3,), fixed frame, of a vehicle near hover.

    x'' = g tan(pitch), y'' = -g tan(roll), z'' = thrust cos(roll) cos(pitch) - g in the
    heading frame, with tilt limited to `MAX_TILT`.
    """
    roll, pitch, _, thrust = control
    roll, pitch = clip(roll, -MAX_TILT, MAX_TILT), clip(pitch, -MAX_TILT, MAX_TILT)
    x, y = rotate_by_yaw(GRAVITY * math.tan(pitch), -GRAVITY * math.tan(roll), yaw)
    return np.array([x, y, thrust * math.cos(roll) * math.cos(pitch) - GRAVITY])


def control_from_acceleration(acceleration: Vector, yaw: float, yaw_dot: float) -> Vector:
    """Return the control of an acceleration: the inverse of `acceleration_from_control`.

    Tilt and thrust are limited as those of the regular controller are.
    """
    x, y, z = acceleration
    forward, left = rotate_by_yaw(x, y, -yaw)
    roll = clip(-math.atan(left / GRAVITY), -MAX_TILT, MAX_TILT)
    pitch = clip(math.atan(forward / GRAVITY), -MAX_TILT, MAX_TILT)
    thrust = (GRAVITY + z) / (math.cos(roll) * math.cos(pitch))
    return np.array([roll, pitch, yaw_dot, clip(thrust, MIN_THRUST, MAX_THRUST)])
