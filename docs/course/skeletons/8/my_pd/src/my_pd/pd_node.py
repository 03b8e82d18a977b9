"""The node: topics and checks are those of the controller that it replaces."""

import math

import numpy as np
from typing_extensions import override

from crazyflie_lqr.linear_feedback import LinearFeedback
from crazyflie_lqr.linear_feedback_node import LinearFeedbackNode, LinearFeedbackParameters
from crazyflie_msgs.msg import PositionVelocityStateStamped, PositionVelocityYawStateStamped
from my_pd.pd import K_YAW, FeedForward, Vector, acceleration, attitude

YAW = 6


class PdFeedback(LinearFeedback):
    """The law of `my_pd.pd`; it does not use the gain file."""

    def __init__(self, parameters: LinearFeedbackParameters):
        super().__init__(parameters.K, parameters.u_ref, YAW)
        self._feed_forward = FeedForward()

    @override
    def control(self, x: Vector, x_ref: Vector, time: float) -> Vector:
        feed_forward = self._feed_forward.acceleration(x_ref[3:6], time)
        wanted = acceleration(x_ref[:3] - x[:3], x_ref[3:6] - x[3:6], feed_forward)
        roll, pitch, thrust = attitude(wanted, x[YAW])
        error = math.remainder(x_ref[YAW] - x[YAW], 2.0 * math.pi)
        return np.array([roll, pitch, K_YAW * error, thrust])


class PdNode(LinearFeedbackNode):
    """Fly to a position and velocity, with the nose along x."""

    state_type = PositionVelocityYawStateStamped
    reference_type = PositionVelocityStateStamped
    reference_tail = (0.0,)
    yaw_index = YAW

    @override
    def make_controller(self, parameters: LinearFeedbackParameters) -> PdFeedback:
        return PdFeedback(parameters)
