"""The formulas of the control law, elementwise: for floats, arrays, and traced values.

Nodes compute with floats, `crazyflie_batch` and vectorized fleets with one array per component;
see `crazyflie_model.elementwise`. States, errors and controls are lists of components as
described in `linear_feedback`. Nothing is changed in place.
"""

import math
from collections.abc import Sequence
from operator import mul

from crazyflie_model.angles import wrap_to_pi
from crazyflie_model.elementwise import Number, Vector, clip, functions, where
from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST

ROLL, PITCH, YAW_DOT, THRUST = range(4)

YAW = 6  #: Index of the yaw in states with position, velocity and yaw.
X_DIM, U_DIM = 7, 4  #: Lengths of these states, and of controls.

#: Smallest and largest value of each control.
LIMITS = (
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
    yaw = x[yaw_index]
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
) -> Number:
    """Return the integral of the position error along an axis after ``dt`` (s), m s.

    Does not grow while it drives the control further into its limit (conditional integration:
    Astrom and Hagglund, Advanced PID Control, 2006, 3.5). The axis is 0, 1 or 2: x, y or z in the
    heading frame; ``error`` is in m, ``linear`` the control of `linear_control`; ``k`` and
    ``limit`` are gain and largest absolute value of this integral, see `linear_feedback`.
    """
    grown = clip(integral + error * dt, -limit, limit)
    low, high = LIMITS[INTEGRATED[axis]]
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


def limited(u: Sequence[Number]) -> Vector[Number]:
    """Return a control within `LIMITS`."""
    return [clip(part, low, high) for part, (low, high) in zip(u, LIMITS, strict=True)]
