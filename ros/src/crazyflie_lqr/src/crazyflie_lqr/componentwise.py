"""The control law of `linear_feedback` by components: for floats, or for many vehicles in arrays.

What a controller remembers is a list of components, as states are; nothing is changed in place.
"""

from collections.abc import Sequence

from crazyflie_lqr.linear_feedback import INTEGRATED, MAX_GAP, PITCH, ROLL, THRUST
from crazyflie_model.angles import wrap_to_pi
from crazyflie_model.elementwise import Number, Vector, clip, functions, where
from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST

X_DIM, U_DIM = 7, 4
"""Of states, which are x, y, z, x_dot, y_dot, z_dot, yaw, and controls."""

LIMITS = {
    ROLL: (-MAX_TILT, MAX_TILT),
    PITCH: (-MAX_TILT, MAX_TILT),
    THRUST: (MIN_THRUST, MAX_THRUST),
}


def heading_error(x: Sequence[Number], x_ref: Sequence[Number]) -> Vector[Number]:
    """Return the error of a state in the heading frame, 7 components.

    See `linear_feedback.heading_error`.
    """
    px, py, pz, vx, vy, vz, turn = (a - b for a, b in zip(x, x_ref, strict=True))
    yaw = x[6]
    c, s = functions(yaw).cos(-yaw), functions(yaw).sin(-yaw)
    return [
        c * px - s * py,
        s * px + c * py,
        pz,
        c * vx - s * vy,
        s * vx + c * vy,
        vz,
        wrap_to_pi(turn),
    ]


def linear_control(
    K: Sequence[Number], u_ref: Sequence[Number], error: Sequence[Number]
) -> Vector[Number]:
    """Return u_ref + K e; K is row by row, 28 components."""
    u = []
    for row, value in enumerate(u_ref):
        for gain, part in zip(K[row * X_DIM :][:X_DIM], error, strict=True):
            value = value + gain * part
        u.append(value)
    return u


def integrate(
    integral: Sequence[Number],
    error: Sequence[Number],
    dt: Number,
    linear: Sequence[Number],
    k: Sequence[Number],
    limit: Sequence[Number],
) -> Vector[Number]:
    """Return the integrals of x, y and z after ``dt`` (s), with conditional integration.

    Parameters
    ----------
    integral : sequence, 3 components
        Before, m s.
    error : sequence
        Of `heading_error`.
    dt : float or ndarray
        Since the last state; adds nothing if it is more than `MAX_GAP`.
    linear : sequence, 4 components
        Of `linear_control`.
    k, limit : sequence, 3 components
        See `linear_feedback.IntegralStateFeedback`.
    """
    dt = where(dt <= MAX_GAP, dt, 0.0)
    after = []
    for axis, control in enumerate(INTEGRATED):
        low, high = LIMITS[control]
        grown = integral[axis] + error[axis] * dt
        grown = where(grown < -limit[axis], -limit[axis], grown)
        grown = where(grown > limit[axis], limit[axis], grown)
        growth = k[axis] * (grown - integral[axis])
        u = linear[control] + k[axis] * grown
        is_into_limit = ((u > high) & (growth > 0.0)) | ((u < low) & (growth < 0.0))
        after.append(where(is_into_limit, integral[axis], grown))
    return after


def limited_control(
    linear: Sequence[Number],
    integral: Sequence[Number] = (0.0, 0.0, 0.0),
    k: Sequence[Number] = (0.0, 0.0, 0.0),
) -> Vector[Number]:
    """Return the control with its integral part, within what controllers ask for."""
    u = list(linear)
    for axis, control in enumerate(INTEGRATED):
        low, high = LIMITS[control]
        u[control] = clip(u[control] + k[axis] * integral[axis], low, high)
    return u
