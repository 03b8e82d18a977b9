"""Quaternions (x, y, z, w) in 32 bits, as they are on the wire."""

import math

from crazyflie_model.angles import Quaternion

_BITS = 9
_MASK = (1 << _BITS) - 1
_ROOT_HALF = math.sqrt(0.5)


def compress_quaternion(quaternion: Quaternion) -> int:
    """Return a unit quaternion (x, y, z, w) in 32 bits.

    The two highest bits are the index of the largest component, which is omitted. The others follow
    in order, each as a sign and 9 bits of magnitude in units of ``sqrt(1/2) / 511``, in the sign
    that makes the largest positive.
    """
    largest = max(range(4), key=lambda i: abs(quaternion[i]))
    flip = quaternion[largest] < 0.0
    word = largest
    for i, component in enumerate(quaternion):
        if i == largest:
            continue
        magnitude = min(_MASK, int(_MASK * abs(component) / _ROOT_HALF + 0.5))
        sign = (component < 0.0) != flip
        word = word << (_BITS + 1) | sign << _BITS | magnitude
    return word


def decompress_quaternion(word: int) -> Quaternion:
    """Return the unit quaternion (x, y, z, w) of 32 bits; inverse of `compress_quaternion`.

    Bits that are not a unit quaternion leave the largest component NaN, as in the firmware.
    """
    largest = word >> 30
    parts = []
    for i in range(3):
        field = word >> (2 - i) * (_BITS + 1)
        magnitude = (field & _MASK) / _MASK * _ROOT_HALF
        parts.append(-magnitude if field >> _BITS & 1 else magnitude)
    rest = 1.0 - sum(part * part for part in parts)
    parts.insert(largest, math.sqrt(rest) if rest >= 0.0 else math.nan)
    x, y, z, w = parts
    return x, y, z, w
