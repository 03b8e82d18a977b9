"""Angles and attitudes.

The workspace writes an attitude as roll, pitch, yaw with
``R = Rx(roll) Ry(pitch) Rz(yaw)`` (intrinsic X-Y-Z), where ``R`` takes body
(forward-left-up) coordinates to the fixed frame. This is not the default order
of tf's helpers, so nodes convert with this module only. Quaternions are
(x, y, z, w), from body to fixed frame.
"""

import math
from collections.abc import Sequence

import numpy as np

from crazyflie_model.elementwise import Number, clip, functions, where

Triple = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

_SMALLEST_COSINE = 1e-6  #: Least cosine of a pitch at which roll and yaw are distinct.


def wrap_to_pi(angle: Number) -> Number:
    """Return the angle in [-pi, pi] that points the same way as a finite one, rad."""
    turned = angle + math.pi
    if isinstance(turned, float):
        return turned % (2.0 * math.pi) - math.pi
    # The remainder, by functions that other types with numpy's protocols support, too.
    return turned - 2.0 * math.pi * np.floor(turned / (2.0 * math.pi)) - math.pi


def quaternion_from_rpy(
    roll: Number, pitch: Number, yaw: Number
) -> tuple[Number, Number, Number, Number]:
    """Return the quaternion (x, y, z, w) of norm 1 of ``Rx(roll) Ry(pitch) Rz(yaw)``, in rad.

    It is the product of the three half-angle quaternions in that order.
    """
    f = functions(roll)
    sr, cr = f.sin(roll / 2.0), f.cos(roll / 2.0)
    sp, cp = f.sin(pitch / 2.0), f.cos(pitch / 2.0)
    sy, cy = f.sin(yaw / 2.0), f.cos(yaw / 2.0)
    return (
        sr * cp * cy + cr * sp * sy,
        cr * sp * cy - sr * cp * sy,
        cr * cp * sy + sr * sp * cy,
        cr * cp * cy - sr * sp * sy,
    )


def rpy_from_quaternion(x: float, y: float, z: float, w: float) -> Triple:
    """Return the (roll, pitch, yaw), rad, of a quaternion of any norm; ValueError if it is zero.

    With the rotation matrix ``R`` of the quaternion: roll = atan2(-R12, R22), pitch = asin(R02),
    yaw = atan2(-R01, R00). At pitch = +-pi/2, where only the sum or difference of roll and yaw is
    defined, roll is 0.
    """
    norm_squared = x * x + y * y + z * z + w * w
    if norm_squared == 0.0:
        raise ValueError("quaternion (0, 0, 0, 0) is not a rotation")
    s = 2.0 / norm_squared
    r00 = 1.0 - s * (y * y + z * z)
    r01 = s * (x * y - w * z)
    r02 = s * (x * z + w * y)
    r12 = s * (y * z - w * x)
    r22 = 1.0 - s * (x * x + y * y)
    pitch = math.asin(max(-1.0, min(1.0, r02)))
    if math.hypot(r00, r01) < _SMALLEST_COSINE:
        r10 = s * (x * y + w * z)
        r11 = 1.0 - s * (x * x + z * z)
        return 0.0, pitch, math.atan2(r10, r11)
    return math.atan2(-r12, r22), pitch, math.atan2(-r01, r00)


def rotate_by_yaw(x: Number, y: Number, yaw: Number) -> tuple[Number, Number]:
    """Return the horizontal vector (x, y) turned counter-clockwise by ``yaw`` (rad)."""
    f = functions(yaw)
    c, s = f.cos(yaw), f.sin(yaw)
    return c * x - s * y, s * x + c * y


def zyx_from_quaternion(quaternion: Sequence[Number]) -> tuple[Number, Number, Number]:
    """Return (roll, pitch, yaw), rad, of a unit quaternion, ``R = Rz(yaw) Ry(pitch) Rx(roll)``.

    This is the order of the firmware, whose roll and pitch are those in the
    heading frame; messages use that of `rpy_from_quaternion`.
    """
    x, y, z, w = quaternion
    f = functions(x)
    return (
        f.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        f.asin(clip(2.0 * (w * y - x * z), -1.0, 1.0)),
        f.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def quaternion_from_zyx(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the quaternion of ``Rz(yaw) Ry(pitch) Rx(roll)``; see `zyx_from_quaternion`."""
    sr, cr = math.sin(roll / 2.0), math.cos(roll / 2.0)
    sp, cp = math.sin(pitch / 2.0), math.cos(pitch / 2.0)
    sy, cy = math.sin(yaw / 2.0), math.cos(yaw / 2.0)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def rotate(quaternion: Sequence[Number], vector: Sequence[Number]) -> tuple[Number, Number, Number]:
    """Return a body-frame vector in the fixed frame, by a quaternion of norm 1."""
    x, y, z, w = quaternion
    a, b, c = vector
    # R v = v + 2 w (u x v) + 2 u x (u x v), with u the quaternion's vector part.
    p, q, r = y * c - z * b, z * a - x * c, x * b - y * a
    return (
        a + 2.0 * (w * p + y * r - z * q),
        b + 2.0 * (w * q + z * p - x * r),
        c + 2.0 * (w * r + x * q - y * p),
    )


def rotate_back(
    quaternion: Sequence[Number], vector: Sequence[Number]
) -> tuple[Number, Number, Number]:
    """Return a vector given in the fixed frame in the body frame; inverse of `rotate`."""
    x, y, z, w = quaternion
    return rotate((-x, -y, -z, w), vector)


def product(p: Sequence[Number], q: Sequence[Number]) -> tuple[Number, Number, Number, Number]:
    """Return the product of two quaternions: the rotation q, then p."""
    (a, b, c, d), (x, y, z, w) = p, q
    return (
        d * x + a * w + b * z - c * y,
        d * y + b * w + c * x - a * z,
        d * z + c * w + a * y - b * x,
        d * w - a * x - b * y - c * z,
    )


def turned(
    quaternion: Sequence[Number], rotation: Sequence[Number]
) -> tuple[Number, Number, Number, Number]:
    """Return a quaternion after a rotation vector (3 components, rad) in the body frame."""
    p, q, r = rotation
    f = functions(p)
    angle = f.sqrt(p * p + q * q + r * r)
    some = where(angle > 0.0, angle, 1.0)
    factor = where(angle > 0.0, f.sin(some / 2.0) / some, 0.5)
    return product(quaternion, (factor * p, factor * q, factor * r, f.cos(angle / 2.0)))
