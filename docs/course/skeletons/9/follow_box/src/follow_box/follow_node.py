"""The node: readings in, velocities out."""

from geometry_msgs.msg import Twist
from sensor_msgs.msg import Range
from typing_extensions import override

from crazyflie_utils import Node, NodeHandle
from follow_box.follower import Follower

TIME_STEP = 0.05
SILENCE = 0.2
"""A reading that is older is not used, s."""


class FollowNode(Node):
    """Publish a velocity all the time; 0 when the sensor is silent."""

    def __init__(self) -> None:
        self._follower = Follower()
        self._reading: float | None = None
        self._time = 0.0

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        """There are no parameters."""

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = handle.publisher("cmd_vel/wanted", Twist)
        # Step 2: subscribe to range/front; keep what message.range is, and handle.time().
        # Step 3: a timer publishes the velocity every TIME_STEP; for the follower, a reading that
        # is older than SILENCE is None.
