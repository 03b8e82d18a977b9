"""Position, velocity, yaw and yaw rate state; a reference without the last two."""

import numpy as np
from typing_extensions import override

from crazyflie_lqr.gain_file import MatrixFile
from crazyflie_lqr.linear_feedback_node import LinearFeedbackNode, LinearFeedbackParameters
from crazyflie_msgs.msg import PositionVelocityStateStamped
from crazyflie_utils import parameter
from crazyflie_utils.parameters.types import Integer
from yaw_lag.msg import YawRateStateStamped


class YawRateStateLqrParameters(LinearFeedbackParameters):
    """Parameters of `YawRateStateLqrNode`."""

    x_dim: int = parameter(Integer(8, 8), "length of the state")
    K: np.ndarray = parameter(MatrixFile(4, 8), "gain file", name="K_file", live=True)


class YawRateStateLqrNode(LinearFeedbackNode):
    """Linear feedback to a position and velocity at yaw 0."""

    state_type = YawRateStateStamped
    reference_type = PositionVelocityStateStamped
    parameters_type = YawRateStateLqrParameters
    yaw_index = 6

    @override
    def complete_reference(self, reference: np.ndarray) -> np.ndarray:
        """Return the reference with yaw and yaw rate 0."""
        return np.append(reference, [0.0, 0.0])
