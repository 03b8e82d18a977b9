"""Frames of a motion capture system, whatever its make."""

from typing import NamedTuple

Vector3 = tuple[float, float, float]  #: x, y, z.
Quaternion = tuple[float, float, float, float]  #: (x, y, z, w).


class Body(NamedTuple):
    """A rigid body in a frame."""

    body_id: int | None  #: Number that the server streams the body under; None when it has none.
    name: str | None  #: Name of the body on the server; None when it is not known.
    position: Vector3  #: m, in the server's coordinates.
    quaternion: Quaternion  #: From the body's axes to the server's coordinates.
    #: Whether the cameras saw the body in this frame; otherwise the pose is an old one, or none.
    is_tracked: bool


class Frame(NamedTuple):
    """All rigid bodies, and markers of none, at one moment."""

    #: When the cameras took the frame, s of the server's clock; None when the stream does not have
    #: it.
    exposure: float | None
    sent: float | None  #: When the server sent it, s of the same clock; None like `exposure`.
    arrival: float  #: When it was received, s of the local clock.
    bodies: tuple[Body, ...]
    #: How long it had been on this machine by then, s; for streams without `exposure`.
    waited: float = 0.0
    #: Markers that the system has not assigned to a body, m, in the server's coordinates.
    points: tuple[Vector3, ...] = ()
