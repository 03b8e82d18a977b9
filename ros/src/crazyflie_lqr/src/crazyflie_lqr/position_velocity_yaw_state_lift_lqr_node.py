"""Position, velocity and yaw state; a reference without yaw."""

import numpy as np

from crazyflie_lqr.linear_feedback import LiftController
from crazyflie_lqr.linear_feedback_node import LinearFeedbackNode
from crazyflie_msgs.msg import PositionVelocityStateStamped, PositionVelocityYawStateStamped
from crazyflie_utils.parameter_types import FINITE, Number


class PositionVelocityYawStateLiftLqrNode(LinearFeedbackNode):
    """Linear feedback with an integrator and limits, to a position and velocity at yaw 0."""

    state_type = PositionVelocityYawStateStamped
    reference_type = PositionVelocityStateStamped
    x_dim = 7
    yaw_index = 6

    def lift(self, reference: np.ndarray) -> np.ndarray:
        """See `LinearFeedbackNode.lift`: the reference yaw is 0."""
        return np.append(reference, 0.0)

    def make_controller(self, handle, K: np.ndarray, u_ref: np.ndarray) -> LiftController:
        """See `LinearFeedbackNode.make_controller`."""
        limit = Number(unit="m s", minimum=0.0)
        return LiftController(
            K,
            u_ref,
            self.yaw_index,
            [handle.param(f"integrator/k/{axis}", FINITE, 0.0) for axis in "xyz"],
            [handle.param(f"integrator/thresh/{axis}", limit, 0.0) for axis in "xyz"],
        )
