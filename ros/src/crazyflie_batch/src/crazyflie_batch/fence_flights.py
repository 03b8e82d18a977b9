"""Flights along one axis that try to leave the walls of a fence, many at once.

Everything is drawn, or chosen against the fence, within the bounds of its proof: the regular
controller, disturbance, errors of the measurements, and when in its spread a control takes effect.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from crazyflie_geofence.viable_set import Axis, response

Array = NDArray[np.float64]

#: A regular controller: time (s), position (m), velocity (m/s) and acceleration (m/s^2) of n
#: vehicles, the latter shape (n,), and the corners of the box; it returns accelerations, (n,).
Controller = Callable[[float, Array, Array, Array, tuple[float, float]], Array]

SUBSTEPS = 4  #: Of a period; delay and spread are whole numbers of them.
_FEATURES, _OUTPUTS = 6, 6
POLICY_SIZE = _FEATURES * _OUTPUTS  #: Numbers that define an adversary.


@dataclass(frozen=True)
class Case:
    """Bounds, walls and length of flights."""

    axis: Axis
    low: float  #: low, high: Walls (m).
    high: float
    ticks: int  #: Periods of a flight.
    excess: float = 1.0  #: The true disturbance over its bound.

    @property
    def substep(self) -> float:
        """Time of a substep, s."""
        return self.axis.period / SUBSTEPS


def rounded(axis: Axis) -> Axis:
    """Return bounds whose delay and spread are whole numbers of substeps."""
    substep = axis.period / SUBSTEPS
    delay, spread = (round(time / substep) * substep for time in (axis.delay, axis.spread))
    return replace(axis, delay=delay, spread=spread)


class Adversary:
    """What acts against the fence: a policy for each flight, shape (POLICY_SIZE, n).

    Linear in position, velocity, acceleration, a sine and a random telegraph; its signs are the
    regular control, the disturbance, both errors, whether a control takes effect late, and how much
    of what is not certain of it the vehicle has.
    """

    def __init__(self, policy: Array, case: Case, random: np.random.Generator):
        self._weights = policy.reshape(_OUTPUTS, _FEATURES, -1)
        self._case, self._random = case, random
        n = policy.shape[1]
        self._sign = np.ones(n)
        self._rate = 10.0 ** random.uniform(-2.5, 0.0, n)
        self._frequency = 10.0 ** random.uniform(-0.5, 1.3, n)

    def act(self, t: float, p: Array, v: Array, a: Array) -> Array:
        """Return control, disturbance, both errors, lateness and share, each -1 to 1."""
        case = self._case
        half, braking = (case.high - case.low) / 2.0, case.axis.braking
        flips = self._random.random(len(p)) < self._rate
        self._sign = np.where(flips, -self._sign, self._sign)
        middle = (case.low + case.high) / 2.0
        features = np.stack(
            [
                (p - middle) / half,
                v / np.sqrt(2.0 * braking * half),
                a / braking,
                np.sin(2.0 * np.pi * self._frequency * t),
                self._sign,
                np.ones_like(p),
            ]
        )
        return np.tanh(20.0 * (self._weights * features).sum(axis=1))


def fly(case: Case, policy: Array, seed: int, controller: Controller | None = None) -> Array:
    """Return how far flights were outside at most, m, shape (n,): negative if always inside.

    They begin at rest, anywhere between the walls' sets. ``policy`` is that of an `Adversary`; a
    ``controller`` takes the place of its regular control.
    """
    axis, random = case.axis, np.random.default_rng(seed)
    n = policy.shape[1]
    adversary = Adversary(policy, case, random)
    v, a = np.zeros((2, n))
    # The controls before have been 0.
    room = axis.position_margin + axis.bulge + axis.reach(axis.velocity_margin, 0.0, 0.0, 0.0)
    p = np.full(n, case.low + room) + (case.high - case.low - 2.0 * room) * random.random(n)
    # The largest and the smallest acceleration that the fence knows of.
    most, least = np.zeros((2, n))
    step = response(case.substep, axis.tau)
    delayed = round(axis.delay / case.substep)
    spread = round(axis.spread / case.substep)
    # Controls in force in the substeps to come, from the present one.
    queue = [np.zeros(n) for _ in range(delayed + spread + 1)]
    last = np.zeros(n)
    was_free = np.ones(n, dtype=bool)
    farthest = np.full(n, -np.inf)
    for tick in range(case.ticks):
        now = tick * axis.period
        regular, d, e_p, e_v, late, share = adversary.act(now, p, v, a)
        wanted = regular * axis.largest
        if controller is not None:
            wanted = np.clip(
                controller(now, p, v, a, (case.low, case.high)), -axis.largest, axis.largest
            )
        shown = p + e_p * axis.position_error, v + e_v * axis.velocity_error
        up, down = (*shown, most), (*shown, least)
        for u in queue[:delayed]:
            up = step.moved(*up, np.maximum(u, -axis.braking), 0.0)
            down = step.moved(*down, np.minimum(u, axis.braking), 0.0)
        control, was_free = _fenced(case, up, down, wanted, last, was_free)
        begin = delayed + np.where(late > 0.0, spread, 0)
        queue += [queue[-1]] * (delayed + spread + SUBSTEPS + 1 - len(queue))
        # Until it takes effect, the control before stays in force.
        queue = [
            u if k < delayed else np.where(k >= begin, control, last) for k, u in enumerate(queue)
        ]
        last = control
        for _ in range(SUBSTEPS):
            u = queue.pop(0)
            certain = np.clip(u, -axis.braking, axis.braking)
            had = certain + (share + 1.0) / 2.0 * (u - certain)
            p, v, a = step.moved(p, v, a, had, d * axis.disturbance * case.excess)
            most = most * step.fade + np.maximum(u, -axis.braking) * (1.0 - step.fade)
            least = least * step.fade + np.minimum(u, axis.braking) * (1.0 - step.fade)
            farthest = np.maximum(farthest, np.maximum(p - case.high, case.low - p))
    return farthest


def _fenced(case, up, down, wanted, last, was_free):
    """Return what the fence makes of controls, and where any control is free.

    ``up`` and ``down`` are position, velocity and acceleration as the upper and the lower wall have
    to expect them.
    """
    axis, top = case.axis, case.axis.largest
    up = case.high - up[0], up[1], up[2]
    down = down[0] - case.low, -down[1], -down[2]
    free = axis.is_free(*up) & axis.is_free(*down)
    (near,) = np.nonzero(~free)
    control = wanted.copy()
    if len(near):
        before = last[near]
        before = np.where(was_free[near], -top, before), np.where(was_free[near], top, before)
        low, high = axis.control_range(
            tuple(each[near] for each in up), tuple(each[near] for each in down), before
        )
        control[near] = np.clip(wanted[near], low, high)
    return control, free
