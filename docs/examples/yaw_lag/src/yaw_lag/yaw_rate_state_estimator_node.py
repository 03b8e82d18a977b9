"""Position, velocity, yaw and yaw rate from tf."""

import numpy as np
from typing_extensions import override

from crazyflie_state_estimator.estimator_node import StateEstimatorNode, StateEstimatorParameters
from crazyflie_state_estimator.motion import EstimatedMotion
from crazyflie_utils import parameter
from crazyflie_utils.parameters.types import Integer
from yaw_lag.msg import YawRateStateStamped


class YawRateStateEstimatorParameters(StateEstimatorParameters):
    """Parameters of `YawRateStateEstimatorNode`."""

    x_dim: int = parameter(Integer(8, 8), "number of fields of the state")


class YawRateStateEstimatorNode(StateEstimatorNode):
    """Publish x, y, z, x_dot, y_dot, z_dot, yaw, yaw_dot."""

    state_type = YawRateStateStamped
    parameters_type = YawRateStateEstimatorParameters

    @override
    def state(self, motion: EstimatedMotion) -> np.ndarray:
        return np.concatenate(
            [motion.position, motion.velocity, motion.attitude[2:], motion.attitude_rate[2:]]
        )
