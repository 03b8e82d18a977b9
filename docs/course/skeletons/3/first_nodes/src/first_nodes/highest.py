"""A subscriber: logs the greatest height of the vehicle."""

import rospy

from crazyflie_msgs.msg import PositionVelocityYawStateStamped

STEP = 0.1
"""A height is logged when it exceeds the last one that was logged by this, m."""


class Highest:
    """Keeps the greatest height that was logged.

    Attributes
    ----------
    height : float
        m.
    """

    def __init__(self):
        self.height = 0.0

    def on_state(self, message: PositionVelocityYawStateStamped) -> None:
        """Log the height, with rospy.loginfo, if it exceeds ``height`` by more than `STEP`."""
        raise NotImplementedError("step 1")


def main() -> None:
    """Process the messages on the topic ``state`` until Ctrl-C."""
    rospy.init_node("highest")
    # Step 2: make a Highest, subscribe to "state" with its method on_state as the callback, spin.
    raise NotImplementedError("step 2")
