"""Formulas of poses that the nodes have for one vehicle only, by components."""

from collections.abc import Sequence

from crazyflie_model.elementwise import Number, Vector, functions, where

_SMALLEST_COSINE = 1e-6  #: Of a pitch at which roll and yaw are distinct.


def yaw_from_quaternion(quaternion: Sequence[Number]) -> Number:
    """Return the yaw of `crazyflie_model.angles.rpy_from_quaternion`, rad."""
    x, y, z, w = quaternion
    f = functions(x)
    s = 2.0 / (x * x + y * y + z * z + w * w)
    r00 = 1.0 - s * (y * y + z * z)
    r01 = s * (x * y - w * z)
    r10 = s * (x * y + w * z)
    r11 = 1.0 - s * (x * x + z * z)
    is_singular = f.hypot(r00, r01) < _SMALLEST_COSINE
    return where(is_singular, f.atan2(r10, r11), f.atan2(-r01, r00))


def turn(quaternion: Sequence[Number], rotation: Sequence[Number]) -> Vector[Number]:
    """Return the quaternion after a rotation vector (rad) in the body frame.

    The error of an attitude in `crazyflie_simulator.motion_capture`.
    """
    x, y, z, w = quaternion
    p, q, r = rotation
    f = functions(p)
    angle = f.sqrt(p * p + q * q + r * r)
    some = where(angle > 0.0, angle, 1.0)
    factor = where(angle > 0.0, f.sin(some / 2.0) / some, 0.5)
    a, b, c, d = factor * p, factor * q, factor * r, f.cos(angle / 2.0)
    return [
        w * a + x * d + y * c - z * b,
        w * b - x * c + y * d + z * a,
        w * c + x * b - y * a + z * d,
        w * d - x * a - y * b - z * c,
    ]
