"""Position, velocity, yaw and yaw rate state; a reference without the last two."""

import numpy as np

from crazyflie_lqr.linear_feedback_node import LinearFeedbackNode
from crazyflie_msgs.msg import PositionVelocityStateStamped
from yaw_lag.msg import YawRateStateStamped


class YawRateStateLqrNode(LinearFeedbackNode):
    """Linear feedback to a position and velocity at yaw 0."""

    state_type = YawRateStateStamped
    reference_type = PositionVelocityStateStamped
    x_dim = 8
    yaw_index = 6

    def lift(self, reference: np.ndarray) -> np.ndarray:
        """See `LinearFeedbackNode.lift`: reference yaw and yaw rate are 0."""
        return np.append(reference, [0.0, 0.0])
