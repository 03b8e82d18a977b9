"""Messages with setpoints and external poses, and how they are sent over the link."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from geometry_msgs.msg import Point, PointStamped, PoseStamped, Quaternion, Vector3

from crazyflie_driver.msg import FullState, Hover, Position, VelocityWorld
from crazyflie_link.crazyflie import Crazyflie


class Sender(NamedTuple):
    """How the messages of a topic are sent, by ``send(crazyflie, message)``.

    ``height_and_yaw(message)`` returns the height (m) and the yaw (degrees) that a setpoint asks
    for; None for none.
    """

    message_type: type
    send: Callable[[Crazyflie, Any], None]
    height_and_yaw: Callable[[Any], tuple[float | None, float | None]] = lambda _: (None, None)


def _full_state(crazyflie, message):
    crazyflie.setpoints.full_state(
        _xyz(message.pose.position),
        _xyz(message.twist.linear),
        _xyz(message.acc),
        _xyzw(message.pose.orientation),
        _xyz(message.twist.angular),
    )


def _external_pose(crazyflie, message):
    pose = message.pose
    crazyflie.localization.pose(_xyz(pose.position), _xyzw(pose.orientation))


#: Topic -> how its messages are sent.
SETPOINTS = {
    "cmd_full_state": Sender(
        FullState, _full_state, lambda m: (m.pose.position.z, _yaw(m.pose.orientation))
    ),
    "cmd_velocity_world": Sender(
        VelocityWorld, lambda c, m: c.setpoints.velocity_world(*_xyz(m.vel), m.yawRate)
    ),
    "cmd_hover": Sender(
        Hover,
        lambda c, m: c.setpoints.hover(m.vx, m.vy, m.yawrate, m.zDistance),
        lambda m: (m.zDistance, None),
    ),
    "cmd_position": Sender(
        Position, lambda c, m: c.setpoints.position(m.x, m.y, m.z, m.yaw), lambda m: (m.z, m.yaw)
    ),
}

#: The same of measured positions.
EXTERNAL = {
    "external_position": Sender(PointStamped, lambda c, m: c.localization.position(*_xyz(m.point))),
    "external_pose": Sender(PoseStamped, _external_pose),
}


def _xyz(vector: Point | Vector3) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def _xyzw(orientation: Quaternion) -> tuple[float, float, float, float]:
    return orientation.x, orientation.y, orientation.z, orientation.w


def _yaw(orientation: Quaternion) -> float:
    # For quaternions of any norm.
    x, y, z, w = _xyzw(orientation)
    return math.degrees(math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z))
