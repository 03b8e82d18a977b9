"""What is drawn around the vehicles: solids, planned paths and geofences of the graph."""

import math
from typing import Any

import roslib.message
from geometry_msgs.msg import Point
from std_msgs.msg import String
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
_HELD = "fleet/waiting"  #: How the topic with the names of vehicles that a fleet holds apart ends.

_FAR = 14.0  #: Where a wall is drawn that a fence does not have, m: the end of the floor.
_MAX_POINTS = 1000  #: Of a path.
_MAX_MARKERS = 2000  #: Of one topic that are drawn: a browser draws each by itself.

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
        # By topic: markers by their frame, and how many there are.
        self._markers: dict[str, tuple[dict[str, list[Marker]], int]] = {}
        self._paths: dict[str, tuple[str, tuple[Triple, ...]]] = {}
        self._fences: dict[str, Box] = {}
        self._held: dict[str, frozenset[str]] = {}
        # By topic and frame: markers, where the frame was, and what was made of them.
        self._made: dict[tuple[str, str], tuple[Any, Any, tuple[Solid, ...]]] = {}
        self._solids: tuple[Solid, ...] = ()

    def follow(self, graph: Graph) -> None:
        """Subscribe to topics that are new on the graph; forget those that are gone."""
        gone = self._topics - graph.topics.keys()
        for known in (self._markers, self._paths, self._fences, self._held):
            for key in [key for key in known if key.partition(" ")[0] in gone]:
                del known[key]
        # A subscription outlives its publisher, and says what the next one has latched.
        for topic, kind in graph.topics.items():
            if topic not in self._topics:
                self._subscribe(topic, kind)

    def solids(self, frames: Frames, fixed: str) -> tuple[Solid, ...]:
        """Return walls and obstacles in the frame ``fixed``; the same object until they change."""
        made = {}
        for topic, (by_frame, _) in self._markers.items():
            for frame, markers in by_frame.items():
                # What moves is drawn in its own frame, at its origin.
                place = ((0.0, 0.0, 0.0),) if frame == fixed else frames.in_fixed(frame, fixed)
                if place is None:
                    continue
                key, at = (topic, frame), (frame == fixed, place[0])
                before, where, solids = self._made.get(key, (None, None, ()))
                if before is not markers or where != at:
                    solids = tuple(s for m in markers if (s := _solid(m, *at)) is not None)
                made[key] = markers, at, solids
        is_new = [each[2] for each in made.values()] != [each[2] for each in self._made.values()]
        self._made = made
        if is_new:
            self._solids = tuple(each for *_, solids in made.values() for each in solids)
        return self._solids

    @property
    def held(self) -> frozenset[str]:
        """Names of the vehicles that a fleet holds, since they are too near to others."""
        return frozenset().union(*self._held.values())

    @property
    def too_many(self) -> tuple[str, ...]:
        """What is not drawn, in words."""
        return tuple(
            f"{count} markers on {topic}; {_MAX_MARKERS} are drawn"
            for topic, (_, count) in self._markers.items()
            if count > _MAX_MARKERS
        )

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
        elif topic.endswith(_HELD) and kind == String._type:
            self._handle.subscribe(
                topic, String, lambda m: self._held.update({topic: frozenset(m.data.split())})
            )
        elif kind == _PATH and (path_type := roslib.message.get_message_class(_PATH)):
            self._handle.subscribe(topic, path_type, lambda message: self._plan(topic, message))
        else:
            return
        self._topics.add(topic)

    def _draw(self, topic, message):
        by_frame: dict[str, list[Marker]] = {}
        for marker in message.markers[:_MAX_MARKERS]:
            by_frame.setdefault(marker.header.frame_id.strip("/"), []).append(marker)
        self._markers[topic] = by_frame, len(message.markers)
        for key in [key for key in self._paths if key.partition(" ")[0] == topic]:
            del self._paths[key]
        for marker in message.markers[:_MAX_MARKERS]:
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


def _solid(marker: Marker, is_fixed: bool, place: Triple) -> Solid | None:
    shape = _SHAPES.get(marker.type)
    if shape is None or marker.action != Marker.ADD:
        return None
    p, q, size, c = marker.pose.position, marker.pose.orientation, marker.scale, marker.color
    position = (p.x, p.y, p.z) if is_fixed else place
    rotation, colour = (q.x, q.y, q.z, q.w), (c.r, c.g, c.b, c.a)
    return Solid(marker.ns, shape, position, rotation, (size.x, size.y, size.z), colour)
