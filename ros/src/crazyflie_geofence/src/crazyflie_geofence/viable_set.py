"""The states of one axis from which a vehicle can stop before a wall, whatever the disturbance.

Position p, velocity v and acceleration a follow p' = v, v' = a + d, a' = (u - a) / tau, with a
disturbance |d| <= D. Under full braking u = -A the vehicle comes to rest after the distance

    s(v, a) = max_t  v t - b t^2 / 2 + c (t - tau (1 - exp(-t / tau))),   b = A - D,  c = a + A,

and the states with p + s(v, a) <= wall are those that it can keep in front of the wall. Theorem and
proof are in docs/geofence_proof.md. All functions take floats for one vehicle or arrays for many.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from crazyflie_model.elementwise import Number, where

_ROOT_STEPS = 5  #: Newton steps, after which the distance is exact to 1e-6 m or better.
_CONTROL_STEPS = 5  #: Newton steps to the largest control.
_SMOOTH = 0.02  #: See `Axis.smooth_hold`, s.
_GRID = 41  #: Speeds and accelerations at which the smallest box is computed.

_SCALAR = SimpleNamespace(exp=math.exp, log=math.log, max=max, min=min)
_ARRAYS = SimpleNamespace(exp=np.exp, log=np.log, max=np.maximum, min=np.minimum)


def _functions(value):
    return _SCALAR if isinstance(value, float) else _ARRAYS


class Response(NamedTuple):
    """What a control and an acceleration do within a time: coefficients of a first-order lag."""

    time: float  #: s
    fade: float  #: Share of the acceleration that is left.
    speed: float  #: Velocity by an acceleration of 1 m/s^2 that fades (s).
    way: float  #: Distance by it (s^2).
    held_speed: float  #: Velocity by a control of 1 m/s^2 (s).
    held_way: float  #: Distance by it (s^2).

    def moved(self, p: Any, v: Any, a: Any, u: Any, d: Any) -> tuple[Any, Any, Any]:
        """Return position, velocity and acceleration after the time.

        Control and disturbance (m/s^2) are constant meanwhile. Floats, or arrays for many vehicles.
        """
        t = self.time
        return (
            p + v * t + a * self.way + u * self.held_way + d * t**2 / 2.0,
            v + a * self.speed + u * self.held_speed + d * t,
            a * self.fade + u * (1.0 - self.fade),
        )


def response(time: float, tau: float) -> Response:
    """Return the coefficients of a time and a lag (s)."""
    fade = math.exp(-time / tau)
    speed = tau * (1.0 - fade)
    way = tau * (time - speed)
    return Response(time, fade, speed, way, time - speed, time * time / 2.0 - way)


@dataclass(frozen=True)
class Axis:
    """What is assumed of a vehicle along one axis; lengths in m, times in s.

    The disturbance is less than the braking.
    """

    tau: float  #: Lag of the acceleration behind the control.
    #: A: acceleration that is always available, either way, m/s^2. Of what is asked for beyond it,
    #: a part may be missing: tilt and thrust do not come at once, nor at the same time.
    braking: float
    largest: float  #: Largest acceleration that a control can ask for, m/s^2; at least A.
    disturbance: float  #: D: largest acceleration beside that of the controls, m/s^2.
    position_error: float  #: Of measured positions.
    velocity_error: float  #: Of measured velocities, m/s.
    delay: float  #: From a measurement to the earliest time at which its control is in force.
    spread: float  #: From the earliest to the latest such time.
    period: float  #: Longest time from one control to the next.

    def disturbed(self, more: float) -> "Axis":
        """Return the same with a disturbance of at least this (m/s^2), as far as braking allows."""
        most = 0.9 * self.braking
        return replace(self, disturbance=max(self.disturbance, min(more, most)))

    @cached_property
    def horizon(self) -> float:
        """Time in which a new control cannot be replaced by another."""
        return self.spread + self.period

    @cached_property
    def position_margin(self) -> float:
        """How far a position at the end of the delay may be from the predicted one."""
        t = self.delay
        return self.position_error + t * (self.velocity_error + self.disturbance * t / 2.0)

    @cached_property
    def velocity_margin(self) -> float:
        """How far a velocity at the end of the delay may be from the predicted one."""
        return self.velocity_error + self.disturbance * self.delay

    @cached_property
    def bulge(self) -> float:
        """How much further than at both ends a vehicle can be within the horizon."""
        return (self.largest + self.disturbance) * self.horizon**2 / 8.0

    @cached_property
    def _gap(self) -> Response:
        return response(self.spread, self.tau)

    @cached_property
    def _hold(self) -> Response:
        return response(self.period, self.tau)

    @cached_property
    def smooth_hold(self) -> Response:
        """For how long the fence's own controls could be held.

        The proof needs a period only, but then 1 cm/s of noise would change them by 1 m/s^2.
        """
        return response(max(self.period, _SMOOTH), self.tau)

    def stopping_distance(self, v: Number, a: Number) -> Number:
        """Return s(v, a): how far a vehicle still moves forwards under full braking.

        0 for one that moves backwards and remains so. Newton's method on the velocity, which is
        concave in time, comes from the right: each step is nearer to the last time of rest.
        """
        return self._stop(v, a)[0]

    def _stop(self, v, a):
        """Return the distance, and its slopes: the time of rest, and what the lag makes of it."""
        f, tau, b = _functions(v), self.tau, self.braking - self.disturbance
        c = f.max(a + self.braking, 0.0)
        k = v + c * tau
        # The velocity falls from this time on.
        top = tau * f.log(f.max(c / b, 1.0))
        t = f.max(k / b, top)
        for _ in range(_ROOT_STEPS):
            fading = c * f.exp(-t / tau)
            slope = f.max(b - fading, 1e-9)
            t = f.max(t + (k - b * t - tau * fading) / slope, top)
        lag = tau * (t - tau * (1.0 - f.exp(-t / tau)))
        return f.max(v * t + c * lag - b * t * t / 2.0, 0.0), t, lag

    def reach(
        self, v: Number, a: Number, gap: Number, u: Number, hold: Response | None = None
    ) -> Number:
        """Return how far a vehicle can get, m, that brakes after one more control.

        At velocity v and acceleration a, ``gap`` (m/s^2) is in force for the spread of the delay,
        then ``u`` for a period, or ``hold``, then full braking, all with the worst disturbance.
        """
        way, v, a = self._after(v, a, gap, u, hold or self._hold)
        return way + self.stopping_distance(v, a)

    def _after(self, v, a, gap, u, hold):
        d = self.disturbance
        return hold.moved(*self._gap.moved(0.0, v, a, gap, d), u, d)

    @cached_property
    def _coarse(self) -> tuple[float, float, float, float]:
        t = self.delay + self.horizon
        change = (self.largest + self.disturbance) * t
        way = self.position_error + t * (self.velocity_error + change / 2.0) + self.bulge
        speed = self.velocity_error + change + (self.largest + self.braking) * self.tau
        return t, way, speed, 0.5 / (self.braking - self.disturbance)

    def is_far(self, room: float, v: float) -> bool:
        """Return whether any control may be in force, whatever has been sent.

        ``room`` is the measured distance from the wall (m), v the measured velocity towards it.
        """
        t, way, speed, factor = self._coarse
        k = v + speed
        return way + v * t + (k * k * factor if k > 0.0 else 0.0) <= room

    def is_free(self, distance: Number, v: Number, a: Number) -> Any:
        """Return whether any control may be in force for the horizon.

        Distance from the wall (m), velocity and acceleration towards it are those predicted for the
        end of the delay.
        """
        farthest = self.reach(v + self.velocity_margin, a, self.largest, self.largest)
        return farthest + self.bulge + self.position_margin <= distance

    def control_range(
        self,
        up: tuple[Number, Number, Number],
        down: tuple[Number, Number, Number],
        last: tuple[Number, Number],
    ) -> tuple[Number, Number]:
        """Return the smallest and the largest control that both walls allow, m/s^2.

        ``up`` and ``down`` are the distances from the upper and the lower wall (m), and velocity
        and acceleration towards it, as in `largest_control`; ``last`` has the smallest and the
        largest control before.
        """
        f = _functions(up[1])
        high = self.smooth_control(*up, last[1])
        low = -self.smooth_control(*down, -last[0])
        contrary = low > high
        if not np.any(contrary):
            return low, high
        # In a box of the proof, those for a period are not contrary.
        high = where(contrary, self.largest_control(*up, last[1]), high)
        low = where(contrary, -self.largest_control(*down, -last[0]), low)
        middle = f.max(f.min((low + high) / 2.0, self.braking), -self.braking)
        return f.min(low, f.max(middle, high)), f.max(high, f.min(middle, low))

    def smooth_control(self, distance: Number, v: Number, a: Number, last: Number) -> Number:
        """Return what is given of any larger control: at least what could be held for longer.

        As long as that is safe, it is not less than the last one: noise changes nothing between.
        For the arguments see `largest_control`.
        """
        f, smooth = _functions(v), self.largest_control(distance, v, a, last, self.smooth_hold)
        return f.max(smooth, f.min(self.largest_control(distance, v, a, last), last))

    def largest_control(
        self, distance: Number, v: Number, a: Number, last: Number, hold: Response | None = None
    ) -> Number:
        """Return the largest control after which the vehicle can stop before the wall, m/s^2.

        Distance from the wall (m), velocity and acceleration are those predicted for the end of the
        delay; ``last`` is the control before. At least -A, which is safe if the state is. It is in
        force for a period, or ``hold``; the longer, the smaller it is.
        """
        f, hold = _functions(v), hold or self._hold
        # A vehicle that may be outside because of its position's error is inside.
        room = f.max(distance - self.position_margin, 0.0) - self.bulge
        v = v + self.velocity_margin
        low, high = 0.0 * v - self.braking, 0.0 * v + self.largest
        if isinstance(v, float) and self.reach(v, a, high, high, hold) <= room:
            return high
        least = self.reach(v, a, f.max(last, low), low, hold) - room
        if isinstance(v, float) and least > 0.0:
            return low
        # The reach is convex in the control: tangents come from above, and the chord between a
        # control that is safe and one that is not stays below the reach's root.
        gap = self._gap
        for _ in range(_CONTROL_STEPS):
            way, speed, acceleration = self._after(v, a, f.max(last, high), high, hold)
            distance, t, lag = self._stop(speed, acceleration)
            # Where the control is in force in the gap, too, it counts for both.
            both = 1.0 * (high > last)
            share = both * (1.0 - gap.fade)
            by_way = hold.held_way + both * gap.held_way
            by_way = by_way + both * gap.held_speed * hold.time + share * hold.way
            by_speed = hold.held_speed + both * gap.held_speed + share * hold.speed
            by_acceleration = 1.0 - hold.fade + share * hold.fade
            moves = 1.0 * (distance > 0.0)
            slope = by_way + moves * (t * by_speed + lag * by_acceleration)
            high = f.max(high - f.max(way + distance - room, 0.0) / slope, low)
        most = f.max(self.reach(v, a, f.max(last, high), high, hold) - room, 0.0)
        u = low + (high - low) * (-least / f.max(most - least, 1e-12))
        return (
            f.min(u, high) if isinstance(v, float) else np.where(least > 0.0, low, f.min(u, high))
        )

    @cached_property
    def smallest_box(self) -> float:
        """Distance of opposite walls from which on they never ask for contrary controls, m.

        The largest sum of both stopping distances of a state at which both walls can matter; see
        the proof.
        """
        b, t = self.braking - self.disturbance, self.delay + self.horizon
        # Towards one wall an acceleration may be this much more than away from the other: of the
        # controls that are sent, and of one that may come early or late.
        late = 2.0 * self.largest
        sent = self.largest - self.braking
        gap = sent + late * (1.0 - self._gap.fade)
        both = 2.0 * (self.velocity_error + self.disturbance * t) + sent * self.delay
        both += late * self._gap.held_speed + gap * self.period
        edges = np.linspace(-self.largest, self.largest, _GRID)
        slack = (self.largest + self.disturbance) * self.horizon

        def lost(a):
            """Return the speed that full braking from an acceleration gains at most."""
            c = np.maximum(a + self.braking, b)
            return self.tau * (c - b - b * np.log(c / b))

        # A cell's largest distances are those of its corners: s grows with v and a.
        largest = 0.0
        for low, high in zip(edges[:-1], edges[1:], strict=True):
            fastest = max(slack, float(lost(-low)))
            high = min(high + gap, self.largest)
            slowest = -both - max(slack, float(lost(high)))
            v = np.linspace(slowest, fastest, _GRID)
            up = self.stopping_distance(v[1:] + both, np.full(_GRID - 1, high))
            down = self.stopping_distance(-v[:-1], np.full(_GRID - 1, -low))
            largest = max(largest, float(np.max(up + down)))
        position = self.position_error + t * (self.velocity_error + self.disturbance * t / 2.0)
        return 2.0 * (position + self.bulge) + gap * t * t / 2.0 + largest
