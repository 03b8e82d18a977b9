"""Trajectories in the compact form in which a client can upload them.

Each axis of a segment is a Bezier curve of degree 0, 1, 3 or 7. The format is
described in the firmware's documentation, "Trajectory formats".
"""

import math
import struct

from crazyflie_model.polynomials import PolynomialPiece, bezier

_START = struct.Struct("<4h")
_HEADER = struct.Struct("<BH")

_POINTS = (0, 1, 3, 7)  #: Control points that are stored for each type of curve: all but the first.

_MILLI = 1e-3
_TENTH_DEGREE = math.pi / 1800.0
_UNITS = (_MILLI, _MILLI, _MILLI, _TENTH_DEGREE)  #: Of x, y, z and yaw: m and rad.


def read_compressed(memory: bytes) -> tuple[PolynomialPiece, ...]:
    """Return the pieces of a compressed trajectory; ValueError if there is not even a start point.

    The memory begins with the start point, 4 numbers of 16 bits: x, y, z in mm and yaw in tenths of
    a degree. Then segments: a byte with two bits for each axis' type of curve, x lowest; the
    duration in ms, 16 bits; the control points of x, of y, of z and of yaw. The first control point
    is the last one before and is left out. It ends with a segment of no duration, or with the
    memory.

    At least one piece is returned: without any segment one of no duration, at the start point.
    """
    if len(memory) < _START.size:
        raise ValueError("a compressed trajectory begins with 8 bytes")
    ends = [unit * n for unit, n in zip(_UNITS, _START.unpack_from(memory), strict=True)]
    pieces = []
    at = _START.size
    while at + _HEADER.size <= len(memory):
        types, milliseconds = _HEADER.unpack_from(memory, at)
        at += _HEADER.size
        counts = [_POINTS[types >> 2 * axis & 3] for axis in range(4)]
        if milliseconds == 0 or at + 2 * sum(counts) > len(memory):
            break
        duration = _MILLI * milliseconds
        axes = []
        for axis, count in enumerate(counts):
            numbers = struct.unpack_from(f"<{count}h", memory, at)
            at += 2 * count
            points = [ends[axis], *(_UNITS[axis] * n for n in numbers)]
            axes.append(bezier(points, duration))
            ends[axis] = points[-1]
        pieces.append(PolynomialPiece(duration, *axes))
    return tuple(pieces) or (PolynomialPiece(0.0, *((end,) for end in ends)),)
