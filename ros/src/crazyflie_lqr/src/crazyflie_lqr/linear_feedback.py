"""Linear state feedback about a reference, in the vehicle's heading frame.

States begin with x, y, z, x_dot, y_dot, z_dot in the fixed frame (m, m/s; z up)
and have the yaw (rad) at some later index. The control is u = (roll, pitch,
yaw_dot, thrust) in rad, rad/s and m/s^2 (mass-normalised): positive roll
accelerates to the right of the heading, positive pitch along it.

The functions are formulas for floats, arrays and traced values (see
`crazyflie_model.elementwise`), which nodes, `crazyflie_batch` and vectorized
fleets share; they change nothing in place.
"""

import math
from collections.abc import Iterable, Sequence
from operator import mul
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import override

from crazyflie_model.angles import wrap_to_pi
from crazyflie_model.elementwise import Number, Vector, clip, functions, where
from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST
from crazyflie_references.governor import Components

ROLL, PITCH, YAW_DOT, THRUST = range(4)

YAW = 6  #: Index of the yaw in states with position, velocity and yaw.
X_DIM, U_DIM = 7, 4  #: Lengths of these states, and of controls.

Limits = Sequence[tuple[float, float]]  #: Smallest and largest value of each control.

#: Those within which every controller of a vehicle stays.
LIMITS: Limits = (
    (-MAX_TILT, MAX_TILT),
    (-MAX_TILT, MAX_TILT),
    (-math.inf, math.inf),
    (MIN_THRUST, MAX_THRUST),
)

INTEGRATED = (PITCH, ROLL, THRUST)  #: The controls that the integrals of x, y and z act on.
MAX_GAP = 0.5  #: Longest time between two states over which the position error is integrated (s).


def heading_error(
    x: Sequence[Number], x_ref: Sequence[Number], yaw_index: int = YAW
) -> Vector[Number]:
    """Return the error of a state, x_dim components, in the heading frame (x forward, y left).

    It is ``x - x_ref``, with the horizontal position and velocity turned by ``-yaw``, which is at
    ``yaw_index`` of the state, and the yaw error wrapped to [-pi, pi].
    """
    e = [a - b for a, b in zip(x, x_ref, strict=True)]
    return _turned(e, x[yaw_index], yaw_index)


def _turned(e, yaw, yaw_index):
    """Turn an error into the heading frame, in place."""
    f = functions(yaw)
    c, s = f.cos(yaw), f.sin(yaw)
    e[0], e[1] = c * e[0] + s * e[1], c * e[1] - s * e[0]
    e[3], e[4] = c * e[3] + s * e[4], c * e[4] - s * e[3]
    e[yaw_index] = wrap_to_pi(e[yaw_index])
    return e


def linear_control(
    K: Sequence[Sequence[Number]], u_ref: Sequence[Number], error: Sequence[Number]
) -> Vector[Number]:
    """Return u_ref + K e; K is a sequence of rows."""
    return [reference + sum(map(mul, row, error)) for reference, row in zip(u_ref, K, strict=True)]


def integrate(
    axis: int,
    integral: Number,
    error: Number,
    dt: Number,
    linear: Sequence[Number],
    k: Number,
    limit: Number,
    limits: Limits = LIMITS,
) -> Number:
    """Return the integral of the position error along an axis after ``dt`` (s), m s.

    Does not grow while it drives the control further into its limit (conditional integration:
    Astrom and Hagglund, Advanced PID Control, 2006, 3.5). The axis is 0, 1 or 2: x, y or z in the
    heading frame; ``error`` is in m, ``linear`` the control of `linear_control`; ``k`` and
    ``limit`` are gain and largest absolute value of this integral, see `LinearFeedback`; ``limits``
    are those of the control.
    """
    grown = clip(integral + error * dt, -limit, limit)
    low, high = limits[INTEGRATED[axis]]
    u = linear[INTEGRATED[axis]] + k * grown
    growth = k * (grown - integral)
    is_into_limit = ((u > high) & (growth > 0.0)) | ((u < low) & (growth < 0.0))
    return where(is_into_limit, integral, grown)


def with_integrals(
    linear: Sequence[Number], integral: Sequence[Number], k: Sequence[Number]
) -> Vector[Number]:
    """Return a control with its integral part added."""
    u = list(linear)
    for control, gain, part in zip(INTEGRATED, k, integral, strict=True):
        u[control] = u[control] + gain * part
    return u


def limited(u: Sequence[Number], limits: Limits = LIMITS) -> Vector[Number]:
    """Return a control within limits."""
    return [clip(part, low, high) for part, (low, high) in zip(u, limits, strict=True)]


SPEED = 0.4  #: Speed of the reference (m/s).
ACCELERATION = 0.5  #: Acceleration of the reference (m/s^2).
#: Largest height of the reference above the vehicle (m): it waits until the vehicle lifts off.
LEAD = 0.15
RATE = 3.0  #: Bandwidth of the observer (1/s).
LEARNING_TIME = 3.0 / RATE  #: Shortest duration of a climb, also over no distance (s).
#: Largest distance (m) and speed (m/s) of a vehicle that has arrived at its goal.
ARRIVAL_DISTANCE, ARRIVAL_SPEED = 0.05, 0.1


class Climb:
    """The climb of a takeoff: a height reference that rises gently, and a thrust that is learned.

    After a step of the reference, the integrator of a soft height loop would collect the error of
    the climb, and the vehicle overshoot. So the reference climbs as fast as a vehicle can follow,
    and a disturbance observer estimates the difference from nominal (Ohnishi et al., Motion control
    for advanced mechatronics, IEEE/ASME Trans. Mechatronics 1(1), 1996):

        z_ddot = thrust - u_ref + d,    d' = RATE (z_ddot - (thrust - u_ref) - d).

    On the ground z_ddot is 0, so that the thrust grows until the vehicle lifts off. At the goal,
    the integrator continues with the thrust that was found. ``limit`` is the largest disturbance
    estimated, m/s^2.
    """

    def __init__(self, limit: float):
        #: Upward acceleration in addition to that of thrust and nominal weight (m/s^2).
        self.disturbance = 0.0
        self.z = self.z_dot = self.z_ddot = 0.0  #: Reference, m, m/s and m/s^2.
        self.has_arrived = False  #: The vehicle is at its goal and the reference, too.
        self._limit = limit
        self._last_z_dot: float | None = None
        self._elapsed = 0.0

    def set_limit(self, limit: float) -> None:
        """Change the largest disturbance, m/s^2, and limit the present estimate."""
        self._limit = limit
        self.disturbance = clip(self.disturbance, -limit, limit)

    def advance(self, dt: float, z: float, z_dot: float, goal: float, excess: float) -> None:
        """Advance to the next state.

        The state is ``dt`` s after the last one (not used with the first), at height ``z`` (m) and
        speed ``z_dot`` (m/s); ``goal`` is the height to climb to (m), ``excess`` the thrust since
        the last state, less that of the reference control (m/s^2).
        """
        if self._last_z_dot is None:
            self.z, self.z_dot = z, z_dot
        else:
            gain = RATE * (z_dot - self._last_z_dot - (excess + self.disturbance) * dt)
            self.disturbance = clip(self.disturbance + gain, -self._limit, self._limit)
            self._advance_reference(dt, z, goal)
        self._last_z_dot = z_dot
        self._elapsed += dt
        is_near = abs(z - goal) < ARRIVAL_DISTANCE and abs(z_dot) < ARRIVAL_SPEED
        has_learned = self._elapsed >= LEARNING_TIME
        self.has_arrived = has_learned and self.z >= goal and (is_near or z > goal)

    def _advance_reference(self, dt, z, goal):
        if dt <= 0.0:
            return
        braking = math.sqrt(2.0 * ACCELERATION * max(goal - self.z, 0.0))
        z_dot = min(self.z_dot + ACCELERATION * dt, SPEED, braking)
        # A larger acceleration is a jump of the reference.
        self.z_ddot = clip((z_dot - self.z_dot) / dt, -2.0 * ACCELERATION, 2.0 * ACCELERATION)
        self.z_dot = z_dot
        self.z = min(self.z + z_dot * dt, z + LEAD)
        if goal - self.z < 1e-3:
            self.z, self.z_dot, self.z_ddot = goal, 0.0, 0.0


LIFTED = 0.05  #: Height of a flying vehicle above the lowest one that was measured (m).
LIFTOFF_TIMEOUT = 3.0  #: Longest time from a change of the reference's height to the liftoff (s).


class GroundGuess:
    """Estimates whether a vehicle flies: when it is `LIFTED`, or may be about to lift off."""

    def __init__(self) -> None:
        self._lowest = math.inf
        self._goal: float | None = None
        self._moved_at = -math.inf

    def is_flying(self, z: float, goal: float, time: float) -> bool:
        """Return the guess for a height and that of the reference (m) at ``time`` (s)."""
        self._lowest = min(self._lowest, z)
        # After a reset of the clock the timeout restarts.
        self._moved_at = min(self._moved_at, time)
        if self._goal is None or abs(goal - self._goal) > LIFTED:
            self._goal = goal
            self._moved_at = time
        return z > self._lowest + LIFTED or time - self._moved_at < LIFTOFF_TIMEOUT


_LEAST_DAMPING = 0.7  #: A height loop with this damping ratio overshoots a step by 5 %.


class LinearFeedback:
    """The control law u = u_ref + K e, with e of `heading_error`.

    A subclass overrides `control`. K has the shape (u_dim, x_dim), with the sign of this formula;
    u_ref is the control at the reference, hover; ``yaw_index`` is where the yaw is in the state.
    """

    def __init__(self, K: Iterable[Iterable[float]], u_ref: Iterable[float], yaw_index: int):
        #: What is flown in place of this controller's control: of each number, or None.
        self.foreign: Sequence[float | None] | None = None
        self._hover_thrust: float | None = None
        self.K = K
        self.u_ref = u_ref
        self.yaw_index = yaw_index

    @property
    def K(self) -> NDArray[np.float64]:  # noqa: N802
        """Gains, shape (u_dim, x_dim); they may be set, though not changed in place."""
        return np.array(self._rows)

    @K.setter
    def K(self, K: Iterable[Iterable[float]]) -> None:  # noqa: N802
        self._rows = [_floats(row) for row in K]

    @property
    def u_ref(self) -> NDArray[np.float64]:
        """Control at the reference, shape (u_dim,); it may be set, too."""
        return np.array(self._u_ref)

    @u_ref.setter
    def u_ref(self, u_ref: Iterable[float]) -> None:
        self._u_ref = _floats(u_ref)
        self.hover_thrust = self._hover_thrust

    @property
    def hover_thrust(self) -> float | None:
        """Thrust of hover measured at the takeoff, m/s^2, in place of that in `u_ref`; or None."""
        return self._hover_thrust

    @hover_thrust.setter
    def hover_thrust(self, thrust: float | None) -> None:
        self._hover_thrust = thrust
        self._u_hover = [*self._u_ref]
        if thrust is not None:
            self._u_hover[THRUST] = thrust

    def control(self, x: ArrayLike, x_ref: ArrayLike, time: float) -> NDArray[np.float64]:
        """Return the control, shape (u_dim,), for a state and a reference, both of shape (x_dim,).

        ``time`` is the state's stamp, s.
        """
        return np.array(linear_control(self._rows, self._u_hover, self._error(x, x_ref)))

    def _error(self, x, x_ref):
        # In plain floats, which are faster for so few numbers; see `heading_error`.
        yaw = float(x[self.yaw_index])
        return _turned(np.subtract(x, x_ref).tolist(), yaw, self.yaw_index)

    def take_over(self, previous: Self) -> None:
        """Continue in flight where a controller with other parameters ends."""
        self.hover_thrust = previous.hover_thrust

    def reset_integrator(self) -> None:
        """Disable and clear the integrator."""

    def enable_integrator(self) -> None:
        """Enable the integrator: the vehicle flies."""

    def take_off(self) -> None:
        """Enable the integrator, and begin the limited climb of a takeoff."""


class IntegralStateFeedback(LinearFeedback):
    """Linear feedback with an integral of the position error, saturated.

    To the linear feedback it adds ``k I`` for each axis: that of x to the pitch, that of y to the
    roll, that of z to the thrust. I is the integral of the position error in the heading frame,
    where a badly trimmed attitude stays the same when the vehicle turns; it stays within +-
    ``integrator_limit``, m s. The gains k are in rad/(m s), rad/(m s) and 1/s^3, with the signs of
    the position gains in K. The control is then limited to ``limits``.

    While a control is at its limit, its integral does not grow into the limit. From
    `reset_integrator` to the next flight it is zero. While its control is `foreign`, it stays.
    After `take_off`, height reference and height integral are those of a `Climb`, which learns from
    the thrust that is flown, until the vehicle has arrived; but not where a step of the reference
    does no harm, with a height loop that is well damped and has no integrator.
    """

    def __init__(
        self,
        K: Iterable[Iterable[float]],
        u_ref: Iterable[float],
        yaw_index: int,
        integrator_k: Components = (0.0, 0.0, 0.0),
        integrator_limit: Components = (0.0, 0.0, 0.0),
        limits: Limits = LIMITS,
    ):
        super().__init__(K, u_ref, yaw_index)
        self._integrator_k = [float(each) for each in integrator_k]
        self._integrator_limit = [float(each) for each in integrator_limit]
        self._limits = limits
        # Axes whose integral acts on the control.
        self._axes = [k for k in range(3) if integrator_k[k] and integrator_limit[k]]
        self._integral = [0.0, 0.0, 0.0]
        self._time: float | None = None
        self._integrates = True
        self._climb: Climb | None = None
        self._thrust = self._u_ref[THRUST]

    @override
    def reset_integrator(self) -> None:
        self._integrates = False
        self._climb = None
        self._integral = [0.0, 0.0, 0.0]

    @override
    def enable_integrator(self) -> None:
        self._integrates = True

    @override
    def take_off(self) -> None:
        self.reset_integrator()
        self.enable_integrator()
        limit = self._climb_limit()
        self._climb = Climb(limit) if limit > 0.0 or self.height_overshoots else None
        self._thrust = self._u_hover[THRUST]

    @override
    def control(self, x: ArrayLike, x_ref: ArrayLike, time: float) -> NDArray[np.float64]:
        """Return the control; states with a gap before them, see `MAX_GAP`, are not integrated."""
        dt = self._time_since_last(time)
        reference, climb_thrust = self._follow_climb(x, x_ref, dt)
        error = self._error(x, reference)
        u = linear_control(self._rows, self._u_hover, error)
        if self._axes:
            if self._integrates:
                self._integrate(error[:3], dt, u)
            u = with_integrals(u, self._integral, self._integrator_k)
        u[THRUST] += climb_thrust
        u = limited(u, self._limits)
        self._thrust = u[THRUST]
        return np.array(u)

    @override
    def take_over(self, previous: Self) -> None:
        """Take over the integral such that ``k I`` does not jump, as far as the limits allow."""
        super().take_over(previous)
        for axis, (before, now) in enumerate(
            zip(previous._integrator_k, self._integrator_k, strict=True)
        ):
            integral = previous._integral[axis]
            if now != 0.0:
                integral = before * integral / now
            limit = self._integrator_limit[axis]
            self._integral[axis] = clip(integral, -limit, limit)
        self._time = previous._time
        self._integrates = previous._integrates
        self._climb = previous._climb
        if self._climb is not None:
            self._climb.set_limit(self._climb_limit())
        self._thrust = previous._thrust

    @property
    def has_integral(self) -> bool:
        """Whether any integral acts on the control."""
        return bool(self._axes)

    @property
    def height_overshoots(self) -> bool:
        """Whether the height loop is damped too little for a step; then take-offs are a `Climb`."""
        # The height loop is s^2 + k_d s + k_p, apart from delays.
        k_p, k_d = -self._rows[THRUST][2], -self._rows[THRUST][5]
        return k_p > 0.0 and k_d < 2.0 * _LEAST_DAMPING * math.sqrt(k_p)

    def _climb_limit(self):
        """Return the largest disturbance that the integrator can compensate, m/s^2."""
        return abs(self._integrator_k[2]) * self._integrator_limit[2]

    def _time_since_last(self, time):
        dt = 0.0 if self._time is None else time - self._time
        self._time = time
        return dt if 0.0 < dt <= MAX_GAP else 0.0

    def _follow_climb(self, x, x_ref, dt):
        """Return the reference, and the thrust of its acceleration, while there is a climb."""
        climb = self._climb
        if climb is None:
            return x_ref, 0.0
        thrust = self._thrust
        if self.foreign is not None and self.foreign[THRUST] is not None:
            thrust = self.foreign[THRUST]
        z, z_dot, goal = float(x[2]), float(x[5]), float(x_ref[2])
        climb.advance(dt, z, z_dot, goal, thrust - self._u_hover[THRUST])
        k, limit = self._integrator_k[2], self._integrator_limit[2]
        if climb.disturbance != 0.0 and k != 0.0:
            self._integral[2] = clip(-climb.disturbance / k, -limit, limit)
        if climb.has_arrived:
            self._climb = None
            return x_ref, 0.0
        x_ref = np.array(x_ref)
        x_ref[2], x_ref[5] = climb.z, climb.z_dot
        return x_ref, climb.z_ddot

    def _integrate(self, error, dt, linear):
        # An error that overflowed must not stay in the integral.
        if dt == 0.0 or not math.isfinite(sum(error)):
            return
        for axis in self._axes:
            # The climb has an integral of its own for the height.
            if axis == 2 and self._climb is not None:
                continue
            if self.foreign is not None and self.foreign[INTEGRATED[axis]] is not None:
                continue
            k, limit = self._integrator_k[axis], self._integrator_limit[axis]
            integral = self._integral[axis]
            self._integral[axis] = integrate(
                axis, integral, error[axis], dt, linear, k, limit, self._limits
            )


def _floats(vector):
    return [float(each) for each in vector]
