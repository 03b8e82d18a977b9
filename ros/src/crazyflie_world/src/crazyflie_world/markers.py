"""What RViz shows of a world."""

from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from crazyflie_model.angles import quaternion_from_rpy
from crazyflie_world.shapes import Ball, Box, Cylinder, Shape
from crazyflie_world.world import World

_SHAPES = {Box: Marker.CUBE, Cylinder: Marker.CYLINDER, Ball: Marker.SPHERE}

_FLOOR_THICKNESS = 0.001  #: m; without one, RViz would draw nothing.


def markers(world: World) -> MarkerArray:
    """Return a marker for each solid; what moves is drawn in its own tf frame, and so moves."""
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
    """Return where a shape is and how it is turned, in the world's frame."""
    yaw = shape.yaw if isinstance(shape, Box) else 0.0
    return Pose(Point(*shape.centre), Quaternion(*quaternion_from_rpy(0.0, 0.0, yaw)))
