"""Solids, planned paths and geofences of the graph, drawn around the vehicles."""

import itertools
import math
from collections import defaultdict
from collections.abc import Mapping
from typing import Any

import numpy as np
import roslib.message
from geometry_msgs.msg import Point
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

from crazyflie_dashboard.discovery import Graph
from crazyflie_dashboard.frames import Frames
from crazyflie_dashboard.snapshot import Placed, Solids, Triple
from crazyflie_model.angles import rotate
from crazyflie_takeoff.envelope import Box
from crazyflie_takeoff.flight_topics import follow_box
from crazyflie_utils import NodeHandle

_MARKERS = ("world/markers", "sweep/markers", "plan/markers")  #: Last names of topics with markers.
_WORLD = "world/markers"  #: Last name of the topic with the objects of a world file.
_LOWEST_ROOM = 1.0  #: Height of objects below which they are not walls of a room (m).
_FENCES = "geofence/parameter_updates"  #: Last name of a geofence's live parameters.
_PATH = "nav_msgs/Path"
_HELD = "fleet/waiting"  #: Last name of the topic with vehicles that a fleet holds apart.

_FAR = 14.0  #: Distance at which missing walls of a fence are drawn: the end of the floor (m).
#: Largest number of points of a path. Largest numbers of drawn markers of one topic, and of points
#: of lists.
_MAX_POINTS = 1000
MAX_PARTS = 100_000

_SHAPES = {Marker.CUBE: "box", Marker.CYLINDER: "cylinder", Marker.SPHERE: "ball"}
_LISTS = {
    Marker.CUBE_LIST: "box",
    Marker.SPHERE_LIST: "ball",
    Marker.POINTS: "points",
    Marker.LINE_LIST: "lines",
}


class Surroundings:
    """Follows topics until its handle is closed; their content is shown while they exist."""

    def __init__(self, handle: NodeHandle):
        self._handle = handle
        self._topics: set[str] = set()
        # Topic -> drawn solids by frame, and number of parts.
        self._markers: dict[str, tuple[list[tuple[str, Solids]], int]] = {}
        self._rooms: dict[str, Box | None] = {}  # By fixed frame, until markers change.
        self._paths: dict[str, tuple[str, tuple[Triple, ...]]] = {}
        self._fences: dict[str, Box] = {}
        self._held: dict[str, frozenset[str]] = {}

    def follow(self, graph: Graph) -> None:
        """Subscribe to topics that are new on the graph; drop those that have gone."""
        gone = self._topics - graph.topics.keys()
        if gone:
            self._rooms.clear()
        for known in (self._markers, self._paths, self._fences, self._held):
            for key in [key for key in known if key.partition(" ")[0] in gone]:
                del known[key]
        # A subscription outlives its publisher, and receives what the next one latches.
        for topic, kind in graph.topics.items():
            if topic not in self._topics:
                self._subscribe(topic, kind)

    def solids(self, frames: Frames, fixed: str) -> tuple[Placed[Solids], ...]:
        """Return the solids of markers, in the frame ``fixed``."""
        return tuple(
            Placed(solids, *place)
            for found, _ in self._markers.values()
            for frame, solids in found
            if (place := frames.in_fixed(frame or fixed, fixed)) is not None
        )

    @property
    def held(self) -> frozenset[str]:
        """Names of the vehicles that a fleet holds because they are too near to others."""
        return frozenset().union(*self._held.values())

    @property
    def too_many(self) -> tuple[str, ...]:
        """Texts about markers that are not drawn."""
        return tuple(
            f"{count} markers and points on {topic}; {MAX_PARTS} are drawn"
            for topic, (_, count) in self._markers.items()
            if count > MAX_PARTS
        )

    def paths(self, frames: Frames, fixed: str) -> dict[str, tuple[Triple, ...]]:
        """Return planned paths, m, in the frame ``fixed``, by the name of the topic."""
        found = {}
        for name, (frame, points) in self._paths.items():
            if frame == fixed:
                found[name] = points
            elif (placed := frames.in_fixed(frame, fixed)) is not None:
                found[name] = tuple(_moved(point, *placed) for point in points)
        return found

    def fences(
        self, frames: Frames, fixed: str, vehicles: Mapping[str, str | None]
    ) -> tuple[Placed[Box], ...]:
        """Return the geofences in the frame ``fixed``, each once.

        ``vehicles`` has the frame of each vehicle by its namespace: the box of its fence is in the
        frame in which it moves.
        """
        found = []
        for topic, box in self._fences.items():
            own = (frame for name, frame in vehicles.items() if topic.startswith(f"{name}/"))
            home = frames.home(next(own, None)) or fixed
            if (place := frames.in_fixed(home, fixed)) is not None:
                found.append(Placed(_drawn(box), *place))
        return tuple(dict.fromkeys(found))

    def box(self, namespace: str) -> Box | None:
        """Return the box of a vehicle's geofence, or None."""
        found = (box for topic, box in self._fences.items() if topic.startswith(f"{namespace}/"))
        return next(found, None)

    def room(self, fixed: str) -> Box | None:
        """Return the box around the objects of a world file (m); None if none of them is high."""
        if fixed not in self._rooms:
            self._rooms[fixed] = self._room(fixed)
        return self._rooms[fixed]

    def _room(self, fixed):
        solids = [
            each
            for topic, (found, _) in self._markers.items()
            for frame, each in found
            if topic.endswith(_WORLD) and frame in ("", fixed) and each.shape in _SHAPES.values()
        ]
        if not solids:
            return None
        rows = np.vstack([each.rows for each in solids]).astype(float)
        turns: Any = rows[:, 3:7].T
        sizes = rows[:, 7:10].T
        corners = np.vstack(
            [
                rows[:, :3] + np.stack(rotate(turns, (x * sizes[0], y * sizes[1], z * sizes[2])), 1)
                for x, y, z in itertools.product((-0.5, 0.5), repeat=3)
            ]
        )
        lower, upper = corners.min(axis=0), corners.max(axis=0)
        if upper[2] < _LOWEST_ROOM:
            return None
        return Box((*map(float, lower[:2]), 0.0), tuple(map(float, upper)))

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
        self._markers[topic] = grouped(message.markers)
        self._rooms.clear()
        for key in [key for key in self._paths if key.partition(" ")[0] == topic]:
            del self._paths[key]
        for marker in message.markers:
            if marker.type == Marker.LINE_STRIP and marker.action == Marker.ADD:
                key = f"{topic} {marker.ns} {marker.id}"
                self._paths[key] = marker.header.frame_id.strip("/"), _path(marker.points)

    def _plan(self, topic, message):
        points = [each.pose.position for each in message.poses]
        self._paths[topic] = message.header.frame_id.strip("/"), _path(points)


def _drawn(box):
    corners = (tuple(min(max(x, -_FAR), _FAR) for x in each) for each in (box.lower, box.upper))
    return Box(*corners)


def _path(points: list[Point]) -> tuple[Triple, ...]:
    step = math.ceil(len(points) / _MAX_POINTS) or 1
    rows = ((p.x, p.y, p.z) for p in [*points[:-1:step], *points[-1:]])
    return tuple(row for row in rows if all(map(math.isfinite, row)))


def _moved(point, position, rotation):
    x, y, z = rotate(rotation, point)
    return position[0] + x, position[1] + y, position[2] + z


def grouped(markers: list[Marker]) -> tuple[list[tuple[str, Solids]], int]:
    """Return the solids of markers with their frame, and the number of parts.

    Markers of one shape, opacity and frame are drawn at once, and so are the points of a list.
    """
    single: dict[tuple[str, str, float], list[tuple[float, ...]]] = defaultdict(list)
    found, count = [], 0
    for marker in markers:
        if marker.action != Marker.ADD:
            continue
        frame, left = marker.header.frame_id.strip("/"), max(0, MAX_PARTS - count)
        if shape := _SHAPES.get(marker.type):
            count += 1
            if left:
                p, s, c = marker.pose.position, marker.scale, marker.color
                row = (p.x, p.y, p.z, *_rotation(marker), s.x, s.y, s.z, c.r, c.g, c.b)
                single[frame, shape, c.a].append(row)
        elif shape := _LISTS.get(marker.type):
            count += len(marker.points)
            if left and marker.points:
                found.append((frame, _listed(shape, marker, left)))
    for (frame, shape, opacity), rows in single.items():
        table = np.array(rows)
        found.append((frame, _solids(shape, table[:, :10], table[:, 10:], opacity)))
    return [each for each in found if len(each[1].rows)], count


def _listed(shape, marker, most):
    p, s, rotation = marker.pose.position, marker.scale, _rotation(marker)
    points = np.array([(each.x, each.y, each.z) for each in marker.points[:most]])
    rows = np.stack(rotate(rotation, tuple(points.T)), axis=1) + (p.x, p.y, p.z)
    if shape in ("box", "ball"):
        rows = np.hstack([rows, np.tile((*rotation, s.x, s.y, s.z), (len(rows), 1))])
    has_own = len(marker.colors) == len(marker.points)
    colours = marker.colors[:most] if has_own else [marker.color]
    table = np.broadcast_to([(each.r, each.g, each.b) for each in colours], (len(rows), 3))
    if shape == "lines":
        pairs = len(rows) // 2
        rows, table = rows[: 2 * pairs].reshape(pairs, 6), table[: 2 * pairs].reshape(pairs, 6)
    return _solids(shape, rows, table, colours[0].a, s.x)


def _solids(shape, rows, colours, opacity, width=0.0):
    """Return the rows that are finite."""
    are_finite = np.isfinite(rows).all(axis=1) & np.isfinite(colours).all(axis=1)
    size = 10 if shape in _SHAPES.values() else 3
    numbers = np.rint(255.0 * np.clip(colours[are_finite], 0.0, 1.0)).astype(np.uint8)
    return Solids(
        shape,
        rows[are_finite].astype(np.float32).reshape(-1, size),
        numbers.reshape(-1, 3),
        opacity,
        width,
    )


def _rotation(marker):
    """Return the quaternion (x, y, z, w) of a marker; many leave it at zero."""
    q = marker.pose.orientation
    return (q.x, q.y, q.z, q.w) if any((q.x, q.y, q.z, q.w)) else (0.0, 0.0, 0.0, 1.0)
