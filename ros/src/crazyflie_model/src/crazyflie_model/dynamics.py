"""Interface of the models of a simulated vehicle; the 7-dimensional models.

State x = (x, y, z, x_dot, y_dot, z_dot, yaw) in the fixed frame (z up), m, m/s
and rad. Control u = (roll, pitch, yaw_dot, thrust) in rad, rad/s and m/s^2
(mass-normalised): the attitude is assumed to follow its command at once.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crazyflie_model.angles import Quaternion, Triple, quaternion_from_rpy, rotate_by_yaw
from crazyflie_model.elementwise import Number, Vector, functions, join, nowhere, split, where
from crazyflie_model.limits import LEVEL_AGE, OFF_AGE
from crazyflie_model.units import GRAVITY

Rates = Callable[[float, Vector[Number], Vector[Number]], Vector[Number]]


def rk4_step(
    rates: Rates[Number], t: float, x: Vector[Number], u: Vector[Number], dt: float
) -> Vector[Number]:
    """Return the state after one classical Runge-Kutta step (4th order) of ``dt`` (s).

    ``rates(t, x, u)`` is the time derivative of every component of the state x at time t (s); the
    control u is constant over the step.
    """
    half = dt / 2.0
    sixth = dt / 6.0
    k1 = rates(t, x, u)
    k2 = rates(t + half, [xi + half * ki for xi, ki in zip(x, k1, strict=True)], u)
    k3 = rates(t + half, [xi + half * ki for xi, ki in zip(x, k2, strict=True)], u)
    k4 = rates(t + dt, [xi + dt * ki for xi, ki in zip(x, k3, strict=True)], u)
    return [
        xi + sixth * (a + 2.0 * (b + c) + d)
        for xi, a, b, c, d in zip(x, k1, k2, k3, k4, strict=True)
    ]


STEP = 0.001  #: Integration step of every model (s).

#: Friction coefficient of a 7-dimensional vehicle on the ground: dry plastic on a hard floor, for
#: which tables have 0.3 to 0.6.
GROUND_FRICTION = 0.5

#: Largest turn of a vehicle in one formula (rad).
_MAX_TURN = 0.06

LEVEL_STEPS = round(LEVEL_AGE / STEP)  #: `LEVEL_AGE` in steps.
_OFF_STEPS = round(OFF_AGE / STEP)


def watchdog_control(u: Vector[Any], age: Any) -> Vector[Any]:
    """Return the effective control for a control (see `Dynamics`) that is ``age`` steps old.

    From `LEVEL_AGE` on it is level and keeps its thrust, from `OFF_AGE` on its motors are off.
    """
    if nowhere(age >= LEVEL_STEPS):
        return [*u]
    *attitude, thrust = u
    level = [where(age < LEVEL_STEPS, each, 0.0) for each in attitude]
    return [*level, where(age < _OFF_STEPS, thrust, 0.0)]


class Dynamics(ABC):
    """A model, for one vehicle or for many.

    States and controls are lists of components (see `elementwise`), except in
    `derivative`, which takes arrays whose last axis is that of the components.
    """

    x_dim: int
    u_dim: int = 4
    has_exact_steps = False  #: Whether a formula gives the state after many steps.

    @abstractmethod
    def initial_state(self, position: Sequence[Number]) -> Vector[Number]:
        """Return the state at rest at a position, three components in m."""

    @abstractmethod
    def rates(self, t: float, x: Vector[Number], u: Vector[Number]) -> Vector[Number]:
        """Return the time derivative of every component of the state, ``t`` s after the start."""

    @abstractmethod
    def apply_ground_contact(self, x: Vector[Number]) -> Vector[Number]:
        """Return the state with the ground, z = 0, taken into account.

        A vehicle below the ground is put on it and loses its downward speed.
        """

    @abstractmethod
    def pose(self, x: Sequence[float], u: Sequence[float]) -> tuple[Triple, Quaternion]:
        """Return the position, in m, and the quaternion (x, y, z, w) of one vehicle."""

    def step(self, count: int, x: Vector[Number], u: Vector[Number]) -> Vector[Number]:
        """Return the state one `STEP` later; ``count`` steps have been done since the start."""
        return self.apply_ground_contact(rk4_step(self.rates, count * STEP, x, u, STEP))

    def steps(self, n: int, count: int, x: Vector[Number], u: Vector[Number]) -> Vector[Number]:
        """Return the state ``n`` `STEP` later: the same as ``n`` times `step`.

        With `has_exact_steps` the rounding errors are different.
        """
        for each in range(count, count + n):
            x = self.step(each, x, u)
        return x

    def derivative(self, t: float, x: ArrayLike, u: ArrayLike) -> NDArray[np.float64]:
        """Return the time derivative, shape as x, ``t`` s after the start.

        x has the shape (x_dim,) or (..., x_dim), u (u_dim,) or (..., u_dim).
        """
        return join(self.rates(t, split(x), split(u)))


class SevenDimensional(Dynamics):
    """Common base of the models with this state; the yaw rate is commanded."""

    x_dim = 7

    #: What is added to the derivative of each component, units of a state over s; None for nothing.
    disturbance: Sequence[float] | None = None

    def __init_subclass__(cls) -> None:
        # A model that is derived from one with a formula may have other rates.
        cls.has_exact_steps = "acceleration" in vars(cls)

    def acceleration(self, u: Sequence[Number], yaw: Number) -> Vector[Number]:
        """Return the acceleration, m/s^2, fixed frame, with a control at a yaw (rad)."""
        raise NotImplementedError

    def rates(self, t: float, x: Vector[Number], u: Vector[Number]) -> Vector[Number]:
        """See `Dynamics.rates`."""
        rates = x[3:6] + self.acceleration(u, x[6]) + [u[2]]
        if self.disturbance is None:
            return rates
        return [a + b for a, b in zip(rates, self.disturbance, strict=True)]

    def initial_state(self, position: Sequence[Number]) -> Vector[Number]:
        """See `Dynamics.initial_state`; yaw is 0."""
        x, y, z = position
        return [x, y, z, 0.0, 0.0, 0.0, 0.0]

    def apply_ground_contact(self, x: Vector[Number]) -> Vector[Number]:
        """See `Dynamics.apply_ground_contact`; the ground also takes horizontal speed, by friction.

        The horizontal speed decreases by `GROUND_FRICTION` times the decrease of the downward speed
        (Coulomb's law: the impulse of the friction is at most this multiple of that of the
        contact). At rest the latter is that of weight minus lift in a step, so that the speed
        decreases at `GROUND_FRICTION` (g - thrust), m/s^2, and not if thrust carries the vehicle.
        """
        below = x[2] <= 0.0
        if nowhere(below):
            return x
        px, py, z, vx, vy, vz, yaw = x
        stopped = below & (vz < 0.0)
        speed = functions(vx).hypot(vx, vy)
        loss = where(stopped, -GROUND_FRICTION * vz, 0.0)
        slides = speed > loss
        share = where(slides, 1.0 - loss / where(slides, speed, 1.0), 0.0)
        share = where(stopped, share, 1.0)
        # The position is corrected for the lost speed; otherwise a tilted vehicle would creep.
        back = (1.0 - share) * (STEP / 2.0)
        return [
            px - back * vx,
            py - back * vy,
            where(below, 0.0, z),
            share * vx,
            share * vy,
            where(stopped, 0.0, vz),
            yaw,
        ]

    def pose(self, x: Sequence[float], u: Sequence[float]) -> tuple[Triple, Quaternion]:
        """See `Dynamics.pose`: roll and pitch are those of the control, yaw is the state's."""
        return (x[0], x[1], x[2]), quaternion_from_rpy(u[0], u[1], x[6])

    def step(self, count: int, x: Vector[Number], u: Vector[Number]) -> Vector[Number]:
        """See `Dynamics.step`."""
        if not self.has_exact_steps or self.disturbance is not None:
            return super().step(count, x, u)
        return self.apply_ground_contact(self._flight(x, u)(STEP, x))

    def steps(self, n: int, count: int, x: Vector[Number], u: Vector[Number]) -> Vector[Number]:
        """See `Dynamics.steps`."""
        if not self.has_exact_steps or self.disturbance is not None:
            return super().steps(n, count, x, u)
        flown = self._flight(x, u)
        duration = n * STEP
        end = flown(duration, x)
        z, vz, end_vz, turn = x[2], x[5], end[5], duration * u[2]
        # The vertical speed is never beyond those of the start and of the end.
        may_touch = (z <= 0.0) | (z + duration * vz <= 0.0) | (z + duration * end_vz <= 0.0)
        if nowhere(may_touch | (turn * turn > _MAX_TURN**2)):
            return end
        for _ in range(n):
            x = self.apply_ground_contact(flown(STEP, x))
        return x

    def _flight(self, x, u):
        """Return ``flown(duration, x)``: the state after a duration (s) in the air.

        Only for models with `has_exact_steps`, which turn by at most `_MAX_TURN` meanwhile. A model
        whose acceleration changes with the yaw overrides this.
        """
        acceleration, yaw_dot = self.acceleration(u, x[6]), u[2]
        return lambda duration, x: _accelerate(duration, x, acceleration, duration * yaw_dot)


def _accelerate(
    duration: float, x: Vector[Number], a: Vector[Number], dyaw: Number
) -> Vector[Number]:
    """Return the state after a duration (s) of constant acceleration, and a turn by ``dyaw``."""
    px, py, pz, vx, vy, vz, yaw = x
    ax, ay, az = a
    half = duration / 2.0
    return [
        px + duration * (vx + half * ax),
        py + duration * (vy + half * ay),
        pz + duration * (vz + half * az),
        vx + duration * ax,
        vy + duration * ay,
        vz + duration * az,
        yaw + dyaw,
    ]


class NearHover(SevenDimensional):
    """Small angles about hover, independent yaw: tilt does not reduce lift."""

    def acceleration(self, u: Sequence[Number], yaw: Number) -> Vector[Number]:
        """Return x_ddot = g tan(pitch), y_ddot = -g tan(roll), z_ddot = thrust - g."""
        roll, pitch, _, thrust = u
        tan = functions(roll).tan
        return [GRAVITY * tan(pitch), -GRAVITY * tan(roll), thrust - GRAVITY]


class Coupled7D(SevenDimensional):
    """Tilt in the heading frame, which reduces lift: thrust, tilt and yaw are coupled."""

    def acceleration(self, u: Sequence[Number], yaw: Number) -> Vector[Number]:
        """See `coupled_acceleration`."""
        return coupled_acceleration(u, yaw)

    def _flight(self, x, u):
        yaw_dot = u[2]
        if nowhere((yaw_dot < 0.0) | (yaw_dot > 0.0)):
            return super()._flight(x, u)
        forward, left, az = _heading_acceleration(u)

        def flown(duration, x):
            # The acceleration turns with the heading. Its integral is its mean, sin(h) / h of it in
            # the direction half-way, with h half the turn; that of the velocity is beside that of
            # this mean by a lag, (1 / h - cot(h)) duration^2 / 2. Of both series, terms of sixth
            # order are neglected: at `_MAX_TURN` they are 2e-13 of the integrals.
            half_turn = duration / 2.0 * yaw_dot
            square = half_turn * half_turn
            mean = 1.0 - square / 6.0 * (1.0 - square / 20.0)
            ax, ay = rotate_by_yaw(mean * forward, mean * left, x[6] + half_turn)
            end = _accelerate(duration, x, [ax, ay, az], 2.0 * half_turn)
            lag = duration * duration * half_turn / 6.0 * (1.0 + square / 15.0)
            end[0] = end[0] + lag * ay
            end[1] = end[1] - lag * ax
            return end

        return flown


def coupled_acceleration(u: Sequence[Number], yaw: Number) -> Vector[Number]:
    """Return the acceleration, m/s^2, fixed frame, of a vehicle that follows a control at once.

    The thrust T, tilted by roll and pitch about the heading (``yaw``, rad), and gravity: x_ddot = T
    (sin(pitch) cos(yaw) + sin(roll) sin(yaw)), y_ddot = T (-sin(roll) cos(yaw) + sin(pitch)
    sin(yaw)), z_ddot = T cos(roll) cos(pitch) - g. The yaw rate has no effect.
    """
    acceleration: Vector[Number] = _heading_acceleration(u)
    x, y = rotate_by_yaw(acceleration[0], acceleration[1], yaw)
    return [x, y, acceleration[2]]


def _heading_acceleration(u: Sequence[Number]) -> Vector[Number]:
    """Return the acceleration forward, left and up, m/s^2."""
    roll, pitch, _, thrust = u
    f = functions(roll)
    lift = thrust * f.cos(roll) * f.cos(pitch)
    return [thrust * f.sin(pitch), -thrust * f.sin(roll), lift - GRAVITY]
