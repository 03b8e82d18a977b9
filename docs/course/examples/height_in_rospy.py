"""Offers a service with plain rospy: the height of the vehicle."""

import rospy
from std_srvs.srv import Trigger, TriggerResponse

from crazyflie_msgs.msg import PositionVelocityYawStateStamped

last = None


def on_state(message: PositionVelocityYawStateStamped) -> None:
    """Keep the newest state."""
    global last
    last = message.state


def on_call(_: Trigger) -> TriggerResponse:
    """Answer a call."""
    if last is None:
        return TriggerResponse(False, "no state has come")
    return TriggerResponse(True, f"{last.z:.2f} m")


rospy.init_node("height")
rospy.Subscriber("/state", PositionVelocityYawStateStamped, on_state)
rospy.Service("/height", Trigger, on_call)
rospy.spin()
