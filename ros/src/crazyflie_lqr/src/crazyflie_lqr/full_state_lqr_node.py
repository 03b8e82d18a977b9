"""Full state; a reference of the same type."""

import numpy as np
from numpy.typing import NDArray

from crazyflie_lqr.gain_file import MatrixFile
from crazyflie_lqr.linear_feedback_node import LinearFeedbackNode, LinearFeedbackParameters
from crazyflie_msgs.msg import FullStateStamped
from crazyflie_utils import parameter
from crazyflie_utils.parameters.types import Integer


class FullStateLqrParameters(LinearFeedbackParameters):
    """Parameters of `FullStateLqrNode`."""

    x_dim: int = parameter(Integer(12, 12), "length of the state")
    K: NDArray[np.float64] = parameter(
        MatrixFile(4, 12), "gain file, `u_dim` rows of `x_dim` numbers", name="K_file", live=True
    )


class FullStateLqrNode(LinearFeedbackNode):
    """Linear feedback to a full state.

    Roll and pitch are taken as the state has them, about the axes of the fixed
    frame; see the package's README for what that means for the gains.
    """

    state_type = FullStateStamped
    reference_type = FullStateStamped
    parameters_type = FullStateLqrParameters
    yaw_index = 8
