"""The controller of the hover examples, with limits and integrator, at a heading of choice."""

from crazyflie_lqr.lqr_nodes import (
    PositionVelocityYawStateLiftLqrNode,
)
from crazyflie_msgs.msg import PositionVelocityYawStateStamped


class HeadingLiftLqrNode(PositionVelocityYawStateLiftLqrNode):
    """Saturated linear feedback with an integrator, to a position, velocity and yaw.

    Without an integrator a real vehicle, which is heavier than the nominal one, flies far too low.
    """

    reference_type = PositionVelocityYawStateStamped
    reference_tail = ()
