"""Goals for crazyflie_controller, as messages."""

from genpy import Time
from geometry_msgs.msg import Point, PoseStamped, Quaternion

from crazyflie_model.angles import quaternion_from_rpy


def goal_message(stamp: Time, frame: str, x: float, y: float, z: float, yaw: float) -> PoseStamped:
    """Return the message of a goal: position in m and heading in rad, in ``frame``."""
    message = PoseStamped()
    message.header.stamp = stamp
    message.header.frame_id = frame
    message.pose.position = Point(x, y, z)
    message.pose.orientation = Quaternion(*quaternion_from_rpy(0.0, 0.0, yaw))
    return message
