"""Asks a server for a velocity every 10 states, and flies it."""

import rospy
from geometry_msgs.msg import Twist

from crazyflie_msgs.msg import PositionVelocityYawStateStamped
from crazyflie_tutorial_msgs.msg import Vel
from crazyflie_tutorial_msgs.srv import Velocity

EVERY = 10
"""States, from one call to the next."""

MIN, MAX = 0.0, 0.4
"""Between which the velocities are: m/s ahead, rad/s counter-clockwise."""


class Wanderer:
    """Flies at random.

    Parameters
    ----------
    ask : callable
        The service: ``ask(MIN, MAX)`` returns a response with ``x`` and ``z``.
    velocities, speeds : rospy.Publisher
        Of Twist, and of Vel.
    """

    def __init__(self, ask, velocities, speeds):
        self._ask = ask
        self._velocities = velocities
        self._speeds = speeds
        self._count = 0

    def on_state(self, message: PositionVelocityYawStateStamped) -> None:
        """Count a state; at every tenth one ask, and publish the answer.

        The Twist has ``x`` as linear.x and ``z`` as angular.z. The Vel has the name "linear" and
        ``x``. When the service fails (rospy.ServiceException), nothing is published but a warning.
        """
        raise NotImplementedError("step 1")


def main() -> None:
    """Fly at random until Ctrl-C."""
    rospy.init_node("wanderer")
    # Step 2: publishers of cmd_vel and speed, a ServiceProxy of the service velocity, for which it
    # waits 10 s at most; then a Wanderer, and a subscriber of state.
    raise NotImplementedError("step 2")
