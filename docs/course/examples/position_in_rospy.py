"""A subscriber with rospy alone: says where the vehicle is."""

import rospy

from crazyflie_msgs.msg import PositionVelocityYawStateStamped


def on_state(message: PositionVelocityYawStateStamped) -> None:
    """Say it, once a second; called for every message."""
    state = message.state
    rospy.loginfo_throttle(1.0, f"the vehicle is at ({state.x:.1f}, {state.y:.1f}, {state.z:.1f})")


rospy.init_node("position_in_rospy")
rospy.Subscriber("/state", PositionVelocityYawStateStamped, on_state)
rospy.spin()
