"""What is drawn around the vehicles: solids, planned paths and geofences of the graph."""

import math

import roslib.message
from geometry_msgs.msg import Point
from visualization_msgs.msg import Marker, MarkerArray

from crazyflie_dashboard.discovery import Graph
from crazyflie_dashboard.frames import Frames
from crazyflie_dashboard.snapshot import Solid, Triple
from crazyflie_model.angles import rotate
from crazyflie_takeoff.flight_topics import follow_box
from crazyflie_takeoff.limits import Box
from crazyflie_utils import NodeHandle

_MARKERS = ("world/markers", "sweep/markers", "plan/markers")  #: How the topics of markers end.
_FENCES = "geofence/parameter_updates"  #: How a topic with the live parameters of a geofence ends.
_PATH = "nav_msgs/Path"

_FAR = 14.0  #: Where a wall is drawn that a fence does not have, m: the end of the floor.
_MAX_POINTS = 1000  #: Of a path.

_SHAPES = {Marker.CUBE: "box", Marker.CYLINDER: "cylinder", Marker.SPHERE: "ball"}


class Surroundings:
    """Follows topics until its handle is closed; what a topic has said is shown while it is there.

    Parameters
    ----------
    handle : NodeHandle
    """

    def __init__(self, handle: NodeHandle):
        self._handle = handle
        self._topics: set[str] = set()
        self._markers: dict[str, list[Marker]] = {}
        self._paths: dict[str, tuple[str, tuple[Triple, ...]]] = {}
        self._fences: dict[str, Box] = {}
        self._solids: tuple[Solid, ...] = ()

    def follow(self, graph: Graph) -> None:
        """Subscribe to topics that are new on the graph; forget those that are gone."""
        gone = self._topics - graph.topics.keys()
        for known in (self._markers, self._paths, self._fences):
            for key in [key for key in known if key.partition(" ")[0] in gone]:
                del known[key]
        # A subscription outlives its publisher, and says what the next one has latched.
        for topic, kind in graph.topics.items():
            if topic not in self._topics:
                self._subscribe(topic, kind)

    def solids(self, frames: Frames, fixed: str) -> tuple[Solid, ...]:
        """Return walls and obstacles in the frame ``fixed``; the same object until they change."""
        found = tuple(
            solid
            for row in self._markers.values()
            for marker in row
            if (solid := _solid(marker, frames, fixed)) is not None
        )
        if found != self._solids:
            self._solids = found
        return self._solids

    def paths(self, frames: Frames, fixed: str) -> dict[str, tuple[Triple, ...]]:
        """Return planned paths, m, in the frame ``fixed``, by the name of the topic."""
        found = {}
        for name, (frame, points) in self._paths.items():
            placed = None if frame == fixed else frames.in_fixed(frame, fixed)
            if placed is not None:
                found[name] = tuple(_moved(point, *placed) for point in points)
            elif frame == fixed:
                found[name] = points
        return found

    @property
    def fences(self) -> tuple[tuple[Triple, Triple], ...]:
        """Lower and upper corners of the geofences, m, each once."""
        return tuple(dict.fromkeys(_drawn(box) for box in self._fences.values()))

    def box(self, namespace: str) -> Box | None:
        """Return the box of a vehicle's geofence; None if it has none."""
        found = (box for topic, box in self._fences.items() if topic.startswith(f"{namespace}/"))
        return next(found, None)

    def _subscribe(self, topic, kind):
        if topic.endswith(_MARKERS) and kind == MarkerArray._type:
            self._handle.subscribe(topic, MarkerArray, lambda message: self._draw(topic, message))
        elif topic.endswith(_FENCES):
            follow_box(self._handle, topic, lambda box: self._fences.update({topic: box}))
        elif kind == _PATH and (path_type := roslib.message.get_message_class(_PATH)):
            self._handle.subscribe(topic, path_type, lambda message: self._plan(topic, message))
        else:
            return
        self._topics.add(topic)

    def _draw(self, topic, message):
        self._markers[topic] = message.markers
        for key in [key for key in self._paths if key.partition(" ")[0] == topic]:
            del self._paths[key]
        for marker in message.markers:
            if marker.type == Marker.LINE_STRIP and marker.action == Marker.ADD:
                key = f"{topic} {marker.ns} {marker.id}"
                self._paths[key] = marker.header.frame_id.strip("/"), _path(marker.points)

    def _plan(self, topic, message):
        points = [each.pose.position for each in message.poses]
        self._paths[topic] = message.header.frame_id.strip("/"), _path(points)


def _drawn(box: Box) -> tuple[Triple, Triple]:
    def near(corner):
        x, y, z = (min(max(each, -_FAR), _FAR) for each in corner)
        return x, y, z

    return near(box.lower), near(box.upper)


def _path(points: list[Point]) -> tuple[Triple, ...]:
    step = math.ceil(len(points) / _MAX_POINTS) or 1
    rows = ((p.x, p.y, p.z) for p in [*points[:-1:step], *points[-1:]])
    return tuple(row for row in rows if all(map(math.isfinite, row)))


def _moved(point, position, rotation):
    x, y, z = rotate(rotation, point)
    return position[0] + x, position[1] + y, position[2] + z


def _solid(marker: Marker, frames: Frames, fixed: str) -> Solid | None:
    shape, frame = _SHAPES.get(marker.type), marker.header.frame_id.strip("/")
    if shape is None or marker.action != Marker.ADD:
        return None
    p, q, size, c = marker.pose.position, marker.pose.orientation, marker.scale, marker.color
    position, rotation = (p.x, p.y, p.z), (q.x, q.y, q.z, q.w)
    if frame != fixed:
        # What moves is drawn in its own frame, at its origin.
        placed = frames.in_fixed(frame, fixed)
        if placed is None:
            return None
        position = placed[0]
    colour = (c.r, c.g, c.b, c.a)
    return Solid(marker.ns, shape, position, rotation, (size.x, size.y, size.z), colour)
