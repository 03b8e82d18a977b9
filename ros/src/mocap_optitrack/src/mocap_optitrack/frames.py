"""Frames of a motion capture system, whatever its make."""

from typing import NamedTuple

Vector3 = tuple[float, float, float]
"""x, y, z."""

Quaternion = tuple[float, float, float, float]
"""(x, y, z, w)."""


class Body(NamedTuple):
    """A rigid body in a frame.

    Attributes
    ----------
    body_id : int or None
        Number that the server streams the body under; None when it has none.
    name : str or None
        Name of the body on the server; None when it is not known.
    position : Vector3
        m, in the server's coordinates.
    quaternion : Quaternion
        From the body's axes to the server's coordinates.
    is_tracked : bool
        Whether the cameras saw the body in this frame; otherwise the pose is an
        old one, or none.
    """

    body_id: int | None
    name: str | None
    position: Vector3
    quaternion: Quaternion
    is_tracked: bool


class Frame(NamedTuple):
    """All rigid bodies, and markers of none, at one moment.

    Attributes
    ----------
    exposure : float or None
        When the cameras took the frame, s of the server's clock; None when the
        stream does not have it.
    sent : float or None
        When the server sent it, s of the same clock; None like `exposure`.
    arrival : float
        When it was received, s of the local clock.
    bodies : tuple of Body
    waited : float
        How long it had been on this machine by then, s; for streams without `exposure`.
    points : tuple of Vector3
        Markers that the system has not assigned to a body, m, in the server's coordinates.
    """

    exposure: float | None
    sent: float | None
    arrival: float
    bodies: tuple[Body, ...]
    waited: float = 0.0
    points: tuple[Vector3, ...] = ()
