"""Frames of a motion capture system, whatever its make, and their axes: z up or y up."""

import math
from typing import Any, NamedTuple

from crazyflie_model.angles import Quaternion, Triple


class SeenBody(NamedTuple):
    """A rigid body in a frame."""

    body_id: int | None  #: Number of the body in the server's stream, or None.
    name: str | None  #: Name of the body on the server; None if it is not known.
    position: Triple  #: m, in the server's coordinates.
    quaternion: Quaternion  #: Rotation from the body's axes to the server's coordinates.
    #: Whether the cameras saw the body in this frame; otherwise the pose is old or undefined.
    is_tracked: bool


class Frame(NamedTuple):
    """All rigid bodies, and markers without a body, at one moment."""

    #: Time of exposure, s of the server's clock; None when the stream does not have it.
    exposure: float | None
    sent: float | None  #: Time of sending by the same clock (s); None like `exposure`.
    arrival: float  #: Time of reception by the local clock (s).
    bodies: tuple[SeenBody, ...]
    #: Time that the frame had been on this machine by then (s); for streams without `exposure`.
    waited: float = 0.0
    #: Markers that the system has not assigned to a body, m, in the server's coordinates.
    points: tuple[Triple, ...] = ()

    @classmethod
    def of(cls, plain: list[Any]) -> "Frame":
        """Return a frame of the lists as which JSON has its tuples."""
        exposure, sent, arrival, bodies, waited, points = plain
        seen = tuple(SeenBody(a, b, tuple(p), tuple(q), tracked) for a, b, p, q, tracked in bodies)
        return cls(exposure, sent, arrival, seen, waited, tuple(map(tuple, points)))


UP_AXES = ("z", "y")  #: Axes that may point up in a stream.
_NORM_TOLERANCE = 0.01  #: Largest difference of the norm of a measured quaternion from 1.


def to_z_up(up_axis: str, position: Triple, quaternion: Quaternion) -> tuple[Triple, Quaternion]:
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
    """Return a measured quaternion with norm 1; None if it is not a rotation."""
    norm = math.hypot(*quaternion)
    # Also false when a component is not a number.
    if not abs(norm - 1.0) < _NORM_TOLERANCE:
        return None
    x, y, z, w = quaternion
    return x / norm, y / norm, z / norm, w / norm
