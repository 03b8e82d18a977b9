#!/usr/bin/env python3
"""A planner with a tracking bound: references along a line, and a control that overrides beyond."""

import math

import rospy
from std_msgs.msg import Empty

from crazyflie_msgs.msg import (
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
    PrioritizedControlStamped,
)

SPEED, BOUND, GRAVITY = 0.3, 0.1, 9.81  # m/s, m, m/s^2


class Planner:
    """Leads from the hover point of a takeoff to a goal; topics are remapped by the launch file."""

    def __init__(self):
        self._goal = rospy.get_param("~goal")
        self._start = None
        self._begin = None
        self._reference = rospy.Publisher("ref", PositionVelocityStateStamped, queue_size=10)
        self._control = rospy.Publisher("control", PrioritizedControlStamped, queue_size=10)
        rospy.Subscriber("state", PositionVelocityYawStateStamped, self._on_state)
        rospy.Subscriber("in_flight", Empty, self._on_toggle)

    def _on_toggle(self, _):
        self._begin = rospy.get_time() if self._begin is None else None

    def _on_state(self, message):
        state = message.state
        place = (state.x, state.y, state.z)
        if self._begin is None:
            self._start = None
            return
        if self._start is None:
            self._start = place
        way = [b - a for a, b in zip(self._start, self._goal, strict=True)]
        length = math.hypot(*way)
        share = min(1.0, SPEED * (rospy.get_time() - self._begin) / length)
        target = [a + share * each for a, each in zip(self._start, way, strict=True)]
        reference = PositionVelocityStateStamped()
        reference.header.stamp = message.header.stamp
        reference.state.x, reference.state.y, reference.state.z = target
        self._reference.publish(reference)
        ahead, left, up = (t - p for t, p in zip(target, place, strict=True))
        output = PrioritizedControlStamped()
        output.header.stamp = message.header.stamp
        output.control.priority = float(math.hypot(ahead, left, up) > BOUND)
        control = output.control.control
        control.pitch = max(-0.2, min(0.2, 0.4 * ahead - 0.4 * state.x_dot))
        control.roll = max(-0.2, min(0.2, -0.4 * left + 0.4 * state.y_dot))
        control.yaw_dot = -state.yaw
        control.thrust = GRAVITY + max(-2.0, min(2.0, 4.0 * up - 4.0 * state.z_dot))
        self._control.publish(output)


rospy.init_node("planner")
Planner()
rospy.spin()
