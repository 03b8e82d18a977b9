"""Parts of a scene: solids of the world, sentences of diagnostics, lines of the log."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rosgraph_msgs.msg import Log
from visualization_msgs.msg import Marker

from crazyflie_dashboard.discovery import Vehicle
from crazyflie_dashboard.frames import Frames
from crazyflie_dashboard.snapshot import Kind, LogLine, Sentence, Solid

WORLD_MARKERS = "world/markers"  #: How topics of crazyflie_world end.
_MAX_AGE = 10.0  #: A diagnostic that is older, s, is not true any more.

_SHAPES = {Marker.CUBE: "box", Marker.CYLINDER: "cylinder", Marker.SPHERE: "ball"}

_LEVELS = {
    Log.DEBUG: "debug",
    Log.INFO: "info",
    Log.WARN: "warn",
    Log.ERROR: "error",
    Log.FATAL: "fatal",
}

_MAX_TEXT = 2000  #: Of a line of the log, characters.


def log_line(number: int, message: Log) -> LogLine:
    """Return a message of /rosout."""
    time, level = message.header.stamp.to_sec(), _LEVELS.get(message.level, "info")
    return LogLine(number, time, level, message.name, message.msg[:_MAX_TEXT])


def solids(
    markers: Mapping[str, Sequence[Marker]],
    frames: Frames,
    fixed: str,
    before: tuple[Solid, ...],
) -> tuple[Solid, ...]:
    """Return what markers show in the frame ``fixed``; ``before`` itself if it is the same."""
    found = []
    for marker in (each for row in markers.values() for each in row):
        shape, frame = _SHAPES.get(marker.type), marker.header.frame_id.strip("/")
        if shape is None or marker.action != Marker.ADD:
            continue
        p, q, size, c = (
            marker.pose.position,
            marker.pose.orientation,
            marker.scale,
            marker.color,
        )
        position, rotation = (p.x, p.y, p.z), (q.x, q.y, q.z, q.w)
        if frame != fixed:
            # What moves is drawn in its own frame, at its origin.
            placed = frames.in_fixed(frame, fixed)
            if placed is None:
                continue
            position = placed[0]
        colour = (c.r, c.g, c.b, c.a)
        found.append(Solid(marker.ns, shape, position, rotation, (size.x, size.y, size.z), colour))
    return before if tuple(found) == before else tuple(found)


class Diagnostics:
    """What nodes say on /diagnostics.

    Parameters
    ----------
    time : callable
        s.
    """

    def __init__(self, time: Callable[[], float]):
        self._time = time
        self._status: dict[str, tuple[float, Any]] = {}

    def take(self, message: DiagnosticArray) -> None:
        """Take a message."""
        for status in message.status:
            self._status[status.name] = self._time(), status

    def sentences(self) -> tuple[Sentence, ...]:
        """Return what is not as it should be, errors first."""
        since = self._time() - _MAX_AGE
        fresh = [status for at, status in self._status.values() if at >= since]
        wrong = sorted(
            (each for each in fresh if each.level != DiagnosticStatus.OK),
            key=lambda each: (-each.level, each.name),
        )
        return tuple(
            Sentence(
                "warn" if each.level == DiagnosticStatus.WARN else "error", each.name, each.message
            )
            for each in wrong
        )

    def kind(self, vehicle: Vehicle) -> Kind:
        """Return what a vehicle is, by the address that its driver has for it."""
        if not vehicle.has_driver:
            return Kind.SIMULATED
        name = vehicle.driver.strip("/")
        for _, status in self._status.values():
            words = status.name.replace(":", " ").replace("/", " ").split()
            if name in words and status.hardware_id.startswith("udp://"):
                return Kind.VIRTUAL
        return Kind.REAL
