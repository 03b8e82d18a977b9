"""Axes of motion capture systems, and those of ROS: x forward, y left, z up (REP 103)."""

import math

from mocap_optitrack.frames import Quaternion, Vector3

UP_AXES = ("z", "y")  #: Axes that may point up in a stream.
_NORM_TOLERANCE = 0.01  #: How far the norm of a measured quaternion may be from 1.


def to_z_up(up_axis: str, position: Vector3, quaternion: Quaternion) -> tuple[Vector3, Quaternion]:
    """Return a pose (m, quaternion) of a stream in coordinates whose z axis points up.

    From y up, the axes are turned by +90 degrees about x, those of the body too: what was (x, y, z)
    becomes (x, -z, y), in the vector part of the quaternion likewise. ``up_axis`` is the stream's,
    one of `UP_AXES`.
    """
    if up_axis == "z":
        return position, quaternion
    x, y, z = position
    a, b, c, w = quaternion
    return (x, -z, y), (a, -c, b, w)


def normalized(quaternion: Quaternion) -> Quaternion | None:
    """Return a measured quaternion with norm 1; None when it is no rotation."""
    norm = math.hypot(*quaternion)
    # Also false when a component is not a number.
    if not abs(norm - 1.0) < _NORM_TOLERANCE:
        return None
    x, y, z, w = quaternion
    return x / norm, y / norm, z / norm, w / norm


def heading(quaternion: Quaternion) -> float:
    """Return where the body's x axis points on the ground, rad in [-pi, pi] from +x to +y.

    The quaternion has norm 1, in coordinates whose z axis points up. This is tf's yaw (roll, pitch
    and yaw about fixed axes), as ground poses have it.
    """
    x, y, z, w = quaternion
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
