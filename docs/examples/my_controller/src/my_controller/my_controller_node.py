"""Position, velocity and yaw state; a reference without yaw, flown with a heading of choice."""

import numpy as np

from crazyflie_lqr.linear_feedback import PITCH, ROLL, LinearFeedback
from crazyflie_lqr.linear_feedback_node import LinearFeedbackNode
from crazyflie_msgs.msg import PositionVelocityStateStamped, PositionVelocityYawStateStamped
from crazyflie_utils.parameter_types import Number


class GentleFeedback(LinearFeedback):
    """Linear feedback that tilts no more than ``max_tilt`` (rad)."""

    def __init__(self, K, u_ref, yaw_index: int, max_tilt: float):
        super().__init__(K, u_ref, yaw_index)
        self._max_tilt = max_tilt

    def control(self, x: np.ndarray, x_ref: np.ndarray, time: float) -> np.ndarray:
        """See `LinearFeedback.control`."""
        u = super().control(x, x_ref, time)
        u[[ROLL, PITCH]] = np.clip(u[[ROLL, PITCH]], -self._max_tilt, self._max_tilt)
        return u


class MyControllerNode(LinearFeedbackNode):
    """Own parameters: ~heading (rad, default 0) and ~max_tilt (rad, default 0.2)."""

    state_type = PositionVelocityYawStateStamped
    reference_type = PositionVelocityStateStamped
    x_dim = 7
    yaw_index = 6

    def __init__(self):
        super().__init__()
        self._heading = None

    def lift(self, reference: np.ndarray) -> np.ndarray:
        """See `LinearFeedbackNode.lift`: the reference yaw is the heading."""
        return np.append(reference, self._heading)

    def make_controller(self, handle, K: np.ndarray, u_ref: np.ndarray) -> GentleFeedback:
        """See `LinearFeedbackNode.make_controller`."""
        self._heading = handle.param("heading", Number(unit="rad"), 0.0)
        max_tilt = handle.param("max_tilt", Number(unit="rad", above=0.0), 0.2)
        return GentleFeedback(K, u_ref, self.yaw_index, max_tilt)
