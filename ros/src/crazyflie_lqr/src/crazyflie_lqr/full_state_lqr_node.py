"""Full state; a reference of the same kind."""

from crazyflie_lqr.linear_feedback_node import LinearFeedbackNode
from crazyflie_msgs.msg import FullStateStamped


class FullStateLqrNode(LinearFeedbackNode):
    """Linear feedback to a full state.

    Roll and pitch are taken as the state has them, about the axes of the fixed
    frame; see the package's README for what that means for the gains.
    """

    state_type = FullStateStamped
    reference_type = FullStateStamped
    x_dim = 12
    yaw_index = 8
