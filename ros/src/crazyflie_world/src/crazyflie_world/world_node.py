"""ROS interface of a world: moves objects with a path, and shows all in RViz."""

from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, TransformStamped, Vector3
from std_msgs.msg import ColorRGBA
from typing_extensions import override
from visualization_msgs.msg import Marker, MarkerArray

from crazyflie_model.angles import quaternion_from_rpy
from crazyflie_msgs.msg import FlightStatus
from crazyflie_utils import Node, NodeHandle, Parameters, parameter, topic
from crazyflie_utils.flight_status import FlightTopics
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import TIME_STEP
from crazyflie_world.shapes import Ball, Box, Cylinder, Shape
from crazyflie_world.world import World
from crazyflie_world.world_file import WORLD_FILE

_SHAPES = {Box: Marker.CUBE, Cylinder: Marker.CYLINDER, Ball: Marker.SPHERE}

_FLOOR_THICKNESS = 0.001  #: Thickness of the floor (m); without it, RViz would draw nothing.


def markers(world: World) -> MarkerArray:
    """Return a marker for each solid; a moving one is in its own tf frame."""
    return MarkerArray([_marker(each, world.frame) for each in world.solids])


def _marker(shape: Shape, frame: str) -> Marker:
    marker = Marker(ns=shape.name, type=_SHAPES[type(shape)])
    marker.color = ColorRGBA(*shape.colour, 1.0)
    marker.scale = Vector3(*(max(length, _FLOOR_THICKNESS) for length in shape.size))
    marker.frame_locked = True
    if shape.path is None:
        marker.header.frame_id = frame
        marker.pose = pose(shape)
    else:
        marker.header.frame_id = shape.name
        marker.pose.orientation = pose(shape).orientation
    return marker


def pose(shape: Shape) -> Pose:
    """Return the pose of a shape in the world's frame."""
    yaw = shape.yaw if isinstance(shape, Box) else 0.0
    return Pose(Point(*shape.centre), Quaternion(*quaternion_from_rpy(0.0, 0.0, yaw)))


class WorldNodeParameters(Parameters):
    """Parameters of `WorldNode`."""

    world: World = parameter(WORLD_FILE, "the world, a YAML file")
    markers_topic: str = topic("markers", "markers for RViz, latched", "world/markers")
    poses_topic: str = topic("poses", "namespace of the moving objects' poses, NAME/pose", "world")
    flight: FlightTopics = group(FlightTopics, "topics")
    time_step: float = parameter(TIME_STEP, "period of the poses", 0.02)


class WorldNode(Node[WorldNodeParameters]):
    """Show a world in RViz; move objects with a path, on /tf and as poses.

    Paths begin when a vehicle flies, if there is a topic of its flight; otherwise at once.
    """

    def __init__(self) -> None:
        self._begin: float | None = None

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        world = parameters.world
        self._poses = {
            each.name: handle.publisher(f"{parameters.poses_topic}/{each.name}/pose", PoseStamped)
            for each in world.moving
        }
        self._broadcast = handle.broadcast_transforms()
        handle.publisher(parameters.markers_topic, MarkerArray, latch=True).publish(markers(world))
        flight = parameters.flight
        if flight.in_flight or flight.status:
            flight.subscribe(handle, self._on_flight_status)
        else:
            self._begin = handle.time()
        if world.moving:
            handle.timer(parameters.time_step, self._on_timer)

    def _on_flight_status(self, status):
        if self._begin is None and status.state == FlightStatus.FLYING:
            self._begin = self._handle.time()

    def _on_timer(self):
        now = self._handle.time()
        elapsed = 0.0 if self._begin is None else now - self._begin
        world = self._parameters.world.at(elapsed)
        stamp = self._handle.stamp(now)
        transforms = []
        for each in world.moving:
            message = PoseStamped(pose=pose(each))
            message.header.stamp = stamp
            message.header.frame_id = world.frame
            self._poses[each.name].publish(message)
            transform = TransformStamped(header=message.header, child_frame_id=each.name)
            transform.transform.translation = Vector3(*each.centre)
            # The frame is parallel to the world's: markers are rotated in it.
            transform.transform.rotation = Quaternion(w=1.0)
            transforms.append(transform)
        self._broadcast(transforms)
