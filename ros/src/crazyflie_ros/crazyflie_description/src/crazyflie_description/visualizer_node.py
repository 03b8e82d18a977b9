"""ROS interface of what RViz shows: the flown path and the reference of a vehicle."""

import math
from collections import deque
from collections.abc import Sequence

from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from typing_extensions import override
from visualization_msgs.msg import Marker, MarkerArray

from crazyflie_model.limits import HOLD_LIMIT
from crazyflie_msgs.msg import PositionVelocityStateStamped, PositionVelocityYawStateStamped
from crazyflie_utils import Node, NodeHandle, Parameters, TransformError, parameter, topic
from crazyflie_utils.parameters.types import BOOLEAN, FRAME


class FlownPath:
    """Positions of a vehicle, thinned out and bounded, for drawing.

    A position nearer than the spacing (m) to the last one kept is dropped; of more positions than
    the capacity the oldest are dropped.
    """

    def __init__(self, spacing: float, capacity: int):
        self._spacing = spacing
        self.positions: deque[tuple[float, ...]] = deque(maxlen=capacity)  #: m, oldest first.
        self._stamp: float | None = None

    def add(self, stamp: float, position: Sequence[float]) -> bool:
        """Append the vehicle's position (x, y, z, m); return whether ``positions`` has changed.

        A stamp (s) before the last one means that time has been reset: the path starts again.
        """
        is_reset = self._stamp is not None and stamp < self._stamp
        self._stamp = stamp
        if is_reset:
            self.positions.clear()
        elif self.positions and math.dist(position, self.positions[-1]) < self._spacing:
            return False
        self.positions.append(tuple(position))
        return True


def circle(
    centre: Sequence[float], radius: float, corners: int
) -> list[tuple[float, float, float]]:
    """Return a closed horizontal polygon about a centre (x, y, z, m): its corners, m.

    The corners, at least 3, have the distance ``radius`` (m); the first is also the last.
    """
    x, y, z = centre
    angles = [2.0 * math.pi * (k % corners) / corners for k in range(corners + 1)]
    return [(x + radius * math.cos(a), y + radius * math.sin(a), z) for a in angles]


PERIOD = 0.05  #: Period of the lookups of the vehicle's pose (s).
SPACING = 0.01  #: Distance between two points of the path (m).
CAPACITY = 2000  #: Largest number of stored points of the path: at least 20 m of flight.

PATH_COLOUR = ColorRGBA(0.05, 0.45, 0.90, 1.0)
REFERENCE_COLOUR = ColorRGBA(0.00, 0.55, 0.30, 1.0)

_LINE_WIDTH = 0.0025
_RING_RADIUS = 0.10  # The vehicle, 7 cm from its middle to its tips, is inside.
_RING_CORNERS = 64
_TEXT_SIZE = 0.016
_LABEL_HEIGHT = 0.075


class VisualizerParameters(Parameters):
    """Parameters of `VisualizerNode`."""

    fixed_frame: str = parameter(FRAME, "frame of the markers", name="frames/fixed")
    robot_frame: str = parameter(FRAME, "frame of the vehicle", name="frames/robot")
    reference_topic: str = topic("reference", "where references come from")
    has_yaw: bool = parameter(
        BOOLEAN,
        "references are PositionVelocityYawStateStamped instead of PositionVelocityStateStamped",
        False,
        "reference/yaw",
    )
    markers_topic: str = topic("markers", "where markers go")


class VisualizerNode(Node[VisualizerParameters]):
    """Publish a vehicle's path and reference as markers.

    Every message contains all markers and the topic is latched, so that an RViz that is started
    late shows everything.
    """

    def __init__(self) -> None:
        self._path = FlownPath(SPACING, CAPACITY)
        self._reference: tuple[float, float, float] | None = None
        self._expiry = math.inf  # When invalid references end it (s).
        self._shown_reference: tuple[float, float, float] | None = None

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._publisher = handle.publisher(parameters.markers_topic, MarkerArray, latch=True)
        self._lookup = handle.listen_to_poses()
        handle.subscribe(
            parameters.reference_topic,
            PositionVelocityYawStateStamped if parameters.has_yaw else PositionVelocityStateStamped,
            self._on_reference,
            finite="state",
            on_invalid=self._on_invalid_reference,
        )
        handle.timer(PERIOD, self._on_timer)

    def _on_reference(self, message):
        self._reference = (message.state.x, message.state.y, message.state.z)
        self._expiry = math.inf

    def _on_invalid_reference(self):
        self._expiry = min(self._expiry, self._handle.time() + HOLD_LIMIT)

    def _on_timer(self):
        path_changed = self._extend_path()
        reference = self._reference if self._handle.time() < self._expiry else None
        if path_changed or reference != self._shown_reference:
            self._shown_reference = reference
            self._publisher.publish(self._markers())

    def _extend_path(self):
        fixed, robot = self._parameters.fixed_frame, self._parameters.robot_frame
        try:
            pose = self._lookup(fixed, robot)
        except TransformError as error:
            self._handle.warn(
                f"no transform {fixed} -> {robot}: {error}", throttle=5.0, key="no transform"
            )
            return False
        return self._path.add(pose.stamp * 1e-9, pose.position)

    def _markers(self):
        path = self._marker("path", Marker.LINE_STRIP, PATH_COLOUR)
        path.points = [Point(*position) for position in self._path.positions]
        ring = self._marker("reference", Marker.LINE_STRIP, REFERENCE_COLOUR)
        label = self._marker("reference label", Marker.TEXT_VIEW_FACING, REFERENCE_COLOUR)
        if self._shown_reference is None:
            ring.action = label.action = Marker.DELETE
        else:
            x, y, z = self._shown_reference
            corners = circle((x, y, z), _RING_RADIUS, _RING_CORNERS)
            ring.points = [Point(*corner) for corner in corners]
            label.text = f"reference ({x:.2f}, {y:.2f}, {z:.2f}) m"
            label.scale.z = _TEXT_SIZE
            label.pose.position = Point(x, y, z + _LABEL_HEIGHT)
        if len(path.points) < 2:
            path.action = Marker.DELETE
        return MarkerArray([path, ring, label])

    def _marker(self, name, shape, colour):
        marker = Marker(ns=name, type=shape, color=colour)
        marker.header.frame_id = self._parameters.fixed_frame
        # The stamp remains 0: RViz uses the latest transform, so that it draws markers with any
        # fixed frame at once, even after simulated time was reset.
        marker.pose.orientation.w = 1.0
        marker.scale.x = _LINE_WIDTH
        return marker
