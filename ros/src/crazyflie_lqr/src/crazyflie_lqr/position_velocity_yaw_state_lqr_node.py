"""Position, velocity and yaw state; a reference of the same type."""

from crazyflie_lqr.linear_feedback_node import LinearFeedbackNode
from crazyflie_msgs.msg import PositionVelocityYawStateStamped


class PositionVelocityYawStateLqrNode(LinearFeedbackNode):
    """Linear feedback to a position, velocity and yaw."""

    state_type = PositionVelocityYawStateStamped
    reference_type = PositionVelocityYawStateStamped
    yaw_index = 6
