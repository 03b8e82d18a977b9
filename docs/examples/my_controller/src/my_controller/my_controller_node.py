"""Position, velocity and yaw state; a reference without yaw, flown with a heading of choice."""

import numpy as np
from typing_extensions import override

from crazyflie_lqr.linear_feedback import PITCH, ROLL, LinearFeedback
from crazyflie_lqr.linear_feedback_node import LinearFeedbackNode, LinearFeedbackParameters
from crazyflie_msgs.msg import PositionVelocityStateStamped, PositionVelocityYawStateStamped
from crazyflie_utils import parameter
from crazyflie_utils.parameters.types import Number


class GentleFeedback(LinearFeedback):
    """Linear feedback that tilts no more than ``max_tilt`` (rad)."""

    def __init__(self, K: np.ndarray, u_ref: np.ndarray, yaw_index: int, max_tilt: float):
        super().__init__(K, u_ref, yaw_index)
        self._max_tilt = max_tilt

    @override
    def control(self, x: np.ndarray, x_ref: np.ndarray, time: float) -> np.ndarray:
        u = super().control(x, x_ref, time)
        u[[ROLL, PITCH]] = np.clip(u[[ROLL, PITCH]], -self._max_tilt, self._max_tilt)
        return u


class MyControllerParameters(LinearFeedbackParameters):
    """Parameters of `MyControllerNode`."""

    heading: float = parameter(Number("rad"), "yaw to hold", 0.0)
    max_tilt: float = parameter(
        Number("rad", above=0.0), "roll and pitch stay within +- this", 0.2, live=True
    )


class MyControllerNode(LinearFeedbackNode):
    """Linear feedback to a position and velocity, with a heading of choice."""

    state_type = PositionVelocityYawStateStamped
    reference_type = PositionVelocityStateStamped
    parameters_type = MyControllerParameters
    yaw_index = 6

    @override
    def make_controller(self, parameters: MyControllerParameters) -> GentleFeedback:
        self._heading = parameters.heading
        return GentleFeedback(parameters.K, parameters.u_ref, self.yaw_index, parameters.max_tilt)

    @override
    def complete_reference(self, reference: np.ndarray) -> np.ndarray:
        return np.append(reference, self._heading)
