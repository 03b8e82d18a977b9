"""Position, velocity, yaw and yaw rate from tf."""

import numpy as np

from crazyflie_state_estimator.estimator_node import StateEstimatorNode
from crazyflie_state_estimator.motion import Motion
from yaw_lag.msg import YawRateState, YawRateStateStamped


class YawRateStateEstimatorNode(StateEstimatorNode):
    """Publish x, y, z, x_dot, y_dot, z_dot, yaw, yaw_dot."""

    def __init__(self):
        super().__init__(YawRateStateStamped, YawRateState)

    def state(self, motion: Motion) -> np.ndarray:
        """See `StateEstimatorNode.state`."""
        return np.concatenate(
            [motion.position, motion.velocity, motion.attitude[2:], motion.attitude_rate[2:]]
        )
