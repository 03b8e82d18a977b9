"""The controller of the hover examples, with limits and integrator, at a heading of choice."""

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from crazyflie_lqr.position_velocity_yaw_state_lift_lqr_node import (
    PositionVelocityYawStateLiftLqrNode,
)
from crazyflie_msgs.msg import PositionVelocityYawStateStamped


class HeadingLiftLqrNode(PositionVelocityYawStateLiftLqrNode):
    """Saturated linear feedback with an integrator, to a position, velocity and yaw.

    Without an integrator a real vehicle, which is heavier than the nominal one, flies far too low.
    """

    reference_type = PositionVelocityYawStateStamped

    @override
    def complete_reference(self, reference: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the reference as it is: it has a yaw."""
        return reference
