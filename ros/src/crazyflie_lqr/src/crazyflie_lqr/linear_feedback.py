"""Linear state feedback about a reference, in the vehicle's heading frame.

States begin with x, y, z, x_dot, y_dot, z_dot in the fixed frame (m, m/s; z up)
and have the yaw (rad) at some later index. The control is u = (roll, pitch,
yaw_dot, thrust) in rad, rad/s and m/s^2 (mass-normalised): positive roll
accelerates to the right of the heading, positive pitch along it.
"""

import math
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import override

from crazyflie_lqr.climb import Climb
from crazyflie_model.angles import rotate_by_yaw, wrap_to_pi
from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST

ROLL, PITCH, YAW_DOT, THRUST = range(4)

_LEAST = np.array([-MAX_TILT, -MAX_TILT, -np.inf, MIN_THRUST])
_MOST = np.array([MAX_TILT, MAX_TILT, np.inf, MAX_THRUST])

_LEAST_DAMPING = 0.7
"""A height loop with this damping ratio overshoots a step by 5 %."""

_INTEGRATED = [PITCH, ROLL, THRUST]
"""The controls that the integrals of x, y and z act on."""

MAX_GAP = 0.5
"""Longest time between two states over which `IntegralStateFeedback` integrates, s."""


def heading_error(
    x: NDArray[np.float64], x_ref: NDArray[np.float64], yaw_index: int
) -> NDArray[np.float64]:
    """Return the error of a state in the heading frame.

    Parameters
    ----------
    x, x_ref : ndarray, shape (x_dim,)
        State and reference.
    yaw_index : int
        Where the yaw is in the state.

    Returns
    -------
    ndarray, shape (x_dim,)
        ``x - x_ref``, with the horizontal position and velocity turned by
        ``-yaw`` into the heading frame (x forward, y left), and the yaw error
        wrapped to [-pi, pi].
    """
    e = x - x_ref
    yaw = x[yaw_index]
    e[0], e[1] = rotate_by_yaw(e[0], e[1], -yaw)
    e[3], e[4] = rotate_by_yaw(e[3], e[4], -yaw)
    e[yaw_index] = wrap_to_pi(e[yaw_index])
    return e


def at_rest(x: NDArray[np.float64], yaw_index: int) -> NDArray[np.float64]:
    """Return the reference, shape (x_dim,), that stays at the place and heading of a state."""
    x_ref = np.zeros_like(x)
    x_ref[:3] = x[:3]
    x_ref[yaw_index] = x[yaw_index]
    return x_ref


class LinearFeedback:
    """The control law u = u_ref + K e, with e of `heading_error`.

    Parameters
    ----------
    K : ndarray, shape (u_dim, x_dim)
        Gains, with the sign that belongs to the plus.
    u_ref : ndarray, shape (u_dim,)
        Control at the reference: hover.
    yaw_index : int
        Where the yaw is in the state.
    """

    def __init__(self, K: NDArray[np.float64], u_ref: NDArray[np.float64], yaw_index: int):
        self.K = K
        self.u_ref = u_ref
        self.yaw_index = yaw_index

    def control(
        self, x: NDArray[np.float64], x_ref: NDArray[np.float64], time: float
    ) -> NDArray[np.float64]:
        """Return the control for a state.

        Parameters
        ----------
        x, x_ref : ndarray, shape (x_dim,)
            State and reference.
        time : float
            When the vehicle was in this state, s: the state's stamp.

        Returns
        -------
        ndarray, shape (u_dim,)
        """
        return self.u_ref + self.K @ heading_error(x, x_ref, self.yaw_index)

    def take_over(self, previous: Self) -> None:
        """Continue in flight where a controller with other parameters ends."""

    def rest(self) -> None:
        """Take note that the control is not flown: the vehicle stands on the ground, say."""

    def fly(self) -> None:
        """Take note that the control is flown from now on, if it was not already."""

    def take_off(self) -> None:
        """Take note that the control is flown from now on, from the ground or the unknown."""


class IntegralStateFeedback(LinearFeedback):
    """Linear feedback with an integral of the position error, saturated.

    To the linear feedback it adds ``k I`` for each axis: that of x to the pitch,
    that of y to the roll, that of z to the thrust. I is the integral of the
    position error in the heading frame, where a badly trimmed attitude stays
    the same when the vehicle turns. Roll and pitch are then limited to
    `MAX_TILT`, thrust to `MIN_THRUST` ... `MAX_THRUST`.

    While a control is at its limit, its integral does not grow into the limit
    (conditional integration: Astrom and Hagglund, Advanced PID Control, 2006, 3.5). Between
    `rest` and the next flight it is zero. After `take_off`, height reference and height
    integral are those of a `Climb` until the vehicle has arrived; but not where a step of the
    reference does no harm, with a height loop that is well damped and has no integrator.

    Parameters
    ----------
    K, u_ref, yaw_index
        See `LinearFeedback`.
    integrator_k : array_like, shape (3,), optional
        Gains of x, y, z in rad/(m s), rad/(m s), 1/s^3, with the signs of the
        position gains in K.
    integrator_limit : array_like, shape (3,), optional
        The integral of each axis stays within +- this, m s.
    """

    def __init__(
        self,
        K: NDArray[np.float64],
        u_ref: NDArray[np.float64],
        yaw_index: int,
        integrator_k: ArrayLike = (0.0, 0.0, 0.0),
        integrator_limit: ArrayLike = (0.0, 0.0, 0.0),
    ):
        super().__init__(K, u_ref, yaw_index)
        self._integrator_k = np.asarray(integrator_k, dtype=float)
        self._integrator_K = np.zeros((len(u_ref), 3))
        self._integrator_K[_INTEGRATED, [0, 1, 2]] = self._integrator_k
        self._integrator_limit = np.asarray(integrator_limit, dtype=float)
        self._integral = np.zeros(3)
        self._time: float | None = None
        self._is_resting = False
        self._climb: Climb | None = None
        self._thrust = float(u_ref[THRUST])

    @override
    def rest(self) -> None:
        self._is_resting = True
        self._climb = None
        self._integral = np.zeros(3)

    @override
    def fly(self) -> None:
        self._is_resting = False

    @override
    def take_off(self) -> None:
        self.rest()
        self.fly()
        limit = float(abs(self._integrator_k[2]) * self._integrator_limit[2])
        self._climb = Climb(limit) if limit > 0.0 or self._height_overshoots() else None
        self._thrust = float(self.u_ref[THRUST])

    @override
    def control(
        self, x: NDArray[np.float64], x_ref: NDArray[np.float64], time: float
    ) -> NDArray[np.float64]:
        """Return the control for a state; see `LinearFeedback.control`.

        A state that is not younger than the last one, or comes more than
        `MAX_GAP` after it, adds nothing to the integral.
        """
        dt = self._time_since_last(time)
        x_ref, climb_thrust = self._follow_climb(x, x_ref, dt)
        e = heading_error(x, x_ref, self.yaw_index)
        linear = self.u_ref + self.K @ e
        if not self._is_resting:
            self._integrate(e[:3], dt, linear)
        u = linear + self._integrator_K @ self._integral
        u[THRUST] += climb_thrust
        u = np.minimum(np.maximum(u, _LEAST), _MOST)
        self._thrust = float(u[THRUST])
        return u

    @override
    def take_over(self, previous: Self) -> None:
        """Take over the integral such that ``k I`` does not jump, as far as the limits allow."""
        scale = np.ones(3)
        np.divide(previous._integrator_k, self._integrator_k, scale, where=self._integrator_k != 0)
        self._integral = self._within_limits(previous._integral * scale)
        self._time = previous._time
        self._is_resting = previous._is_resting
        self._climb = previous._climb
        self._thrust = previous._thrust

    def _height_overshoots(self):
        # The height loop is s^2 + k_d s + k_p, without regard to delays.
        k_p, k_d = -self.K[THRUST, 2], -self.K[THRUST, 5]
        return k_p > 0.0 and k_d < 2.0 * _LEAST_DAMPING * math.sqrt(k_p)

    def _time_since_last(self, time):
        dt = 0.0 if self._time is None else time - self._time
        self._time = time
        return dt if 0.0 < dt <= MAX_GAP else 0.0

    def _follow_climb(self, x, x_ref, dt):
        """Return the reference, and the thrust of its acceleration, while there is a climb."""
        climb = self._climb
        if climb is None:
            return x_ref, 0.0
        climb.advance(dt, x[2], x[5], x_ref[2], self._thrust - self.u_ref[THRUST])
        if climb.disturbance != 0.0:
            self._integral[2] = -climb.disturbance / self._integrator_k[2]
        if climb.has_arrived:
            self._climb = None
            return x_ref, 0.0
        x_ref = x_ref.copy()
        x_ref[2], x_ref[5] = climb.z, climb.z_dot
        return x_ref, climb.z_ddot

    def _integrate(self, error, dt, linear):
        # An error that overflowed must not stay in the integral.
        if dt == 0.0 or not np.isfinite(error).all():
            return
        integral = self._within_limits(self._integral + error * dt)
        u = linear + self._integrator_K @ integral
        growth = self._integrator_K @ (integral - self._integral)
        at_limit = ((u > _MOST) & (growth > 0.0)) | ((u < _LEAST) & (growth < 0.0))
        grows = ~at_limit[_INTEGRATED]
        if self._climb is not None:
            grows[2] = False
        self._integral[grows] = integral[grows]

    def _within_limits(self, integral):
        limit = self._integrator_limit
        return np.minimum(np.maximum(integral, -limit), limit)
