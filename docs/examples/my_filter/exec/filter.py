#!/usr/bin/env python
"""A safety filter: it overrides the pitch of a controller that would fly through a wall."""

import math

import numpy as np
import rospy
from std_msgs.msg import String

from crazyflie_msgs.msg import (
    ControlStamped,
    PositionVelocityYawStateStamped,
    PrioritizedControlStamped,
)

GRAVITY = 9.81
STEEPEST = 0.26  # rad


class Filter:
    """A control barrier function for x <= wall, of a vehicle whose heading is 0.

    The acceleration must be at most rate^2 (wall - x) - 2 rate x_dot: then the distance from the
    wall decays, and never below 0 (A. Ames et al., Control barrier functions, 2019).
    """

    def __init__(self):
        self._wall = rospy.get_param("~wall", 0.5)
        rate = rospy.get_param("~rate", 2.0)
        self._gains = np.array([rate**2, -2.0 * rate])
        self._state = None
        self._publisher = rospy.Publisher(
            "control/filter", PrioritizedControlStamped, queue_size=10
        )
        rospy.Subscriber("state", PositionVelocityYawStateStamped, self._on_state)
        rospy.Subscriber("control/lqr", ControlStamped, self._on_control)

    def _on_state(self, message):
        self._state = message.state

    def _on_control(self, message):
        if self._state is None:
            return
        limit = self._gains @ np.array([self._wall - self._state.x, self._state.x_dot])
        steepest = float(np.clip(math.atan(limit / GRAVITY), -STEEPEST, STEEPEST))
        output = PrioritizedControlStamped()
        output.header.stamp = message.header.stamp
        output.control.control = message.control
        # It leaves the rest to the controller.
        output.control.priority = float(message.control.pitch > steepest)
        output.control.control.pitch = min(message.control.pitch, steepest)
        self._publisher.publish(output)


rospy.init_node("my_filter")
version = rospy.Publisher("~numpy", String, queue_size=1, latch=True)
version.publish(np.__version__)
node = Filter()
rospy.spin()
