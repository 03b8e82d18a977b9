"""ROS interface of the markers of a fleet: bodies, buffers and names."""

from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import ColorRGBA, String
from typing_extensions import override
from visualization_msgs.msg import Marker, MarkerArray

from crazyflie_fleet.fleet_config import DOWNWASH, NONE, VehicleConfig
from crazyflie_fleet.fleet_parameters import FleetParameters
from crazyflie_utils import Node, NodeHandle, topic

BODY = ColorRGBA(0.15, 0.17, 0.20, 1.0)
NAME = ColorRGBA(0.05, 0.25, 0.60, 1.0)
FREE = ColorRGBA(0.05, 0.45, 0.90, 0.12)
HELD = ColorRGBA(0.85, 0.15, 0.10, 0.45)

_ROTOR = 0.0325  #: Distance from the middle to a rotor, along x and along y (m).

_OBSTACLE_SIZE = 0.1  #: Edge of the cube of a body that is not flown (m).
_TEXT_SIZE = 0.12

PERIOD = 1.0  #: Period of the messages (s): RViz drops a marker that comes before its frame.


class FleetMarkersParameters(FleetParameters):
    """Parameters of `FleetMarkersNode`."""

    held_topic: str = topic("waiting", "names of the vehicles that are held", "/fleet/waiting")
    markers_topic: str = topic("markers", "markers", "/fleet/markers")


class FleetMarkersNode(Node):
    """Publishes markers, which RViz moves with the vehicles' frames."""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(FleetMarkersParameters)
        self._fleet = self._parameters.fleet()

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._publisher = handle.publisher(parameters.markers_topic, MarkerArray)
        self._held: frozenset[str] = frozenset()
        handle.subscribe(parameters.held_topic, String, self._on_held)
        handle.timer(PERIOD, self._publish, steady=True)

    def _on_held(self, message):
        self._held = frozenset(message.data.split())
        self._publish()

    def _publish(self):
        markers = [
            marker
            for number, vehicle in enumerate((*self._fleet.vehicles, *self._fleet.obstacles))
            for marker in _markers(number, vehicle, vehicle.name in self._held)
        ]
        self._publisher.publish(MarkerArray(markers))


def _markers(number: int, vehicle: VehicleConfig, is_held: bool) -> list[Marker]:
    radius = vehicle.buffer
    is_vehicle = vehicle.connection != NONE
    kind, size = (Marker.SPHERE_LIST, 0.05) if is_vehicle else (Marker.CUBE, _OBSTACLE_SIZE)
    body = _marker("bodies", number, vehicle, kind, BODY, (size, size, size))
    body.points = [Point(x, y, 0.0) for x in (-_ROTOR, _ROTOR) for y in (-_ROTOR, _ROTOR)]
    space = (2.0 * radius, 2.0 * radius, 2.0 * radius * DOWNWASH)
    buffer = _marker("buffers", number, vehicle, Marker.SPHERE, HELD if is_held else FREE, space)
    name = _marker("names", number, vehicle, Marker.TEXT_VIEW_FACING, NAME, (0.0, 0.0, _TEXT_SIZE))
    name.text = vehicle.name
    name.pose.position.z = 0.15
    return [body, buffer, name]


def _marker(namespace, number, vehicle, kind, colour, size):
    marker = Marker(ns=namespace, id=number, type=kind, color=colour, scale=Vector3(*size))
    marker.header.frame_id = vehicle.name
    marker.frame_locked = True
    marker.pose.orientation.w = 1.0
    return marker
