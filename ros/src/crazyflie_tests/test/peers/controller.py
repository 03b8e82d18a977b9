#!/usr/bin/env python3
"""Linear feedback: u = u_ref + K (x - x_ref), silent until a reference has come."""

import math

import numpy as np
import rospy

from crazyflie_msgs.msg import (
    ControlStamped,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)


class Controller:
    """Answers every state with a control."""

    def __init__(self):
        self._K = np.loadtxt(rospy.get_param("~K_file"))
        self._u_ref = np.loadtxt(rospy.get_param("~u_ref_file"))
        self._x_ref = None
        self._publisher = rospy.Publisher(
            rospy.get_param("~topics/control"), ControlStamped, queue_size=10
        )
        topics = rospy.get_param("~topics")
        rospy.Subscriber(topics["reference"], PositionVelocityStateStamped, self._on_reference)
        rospy.Subscriber(topics["state"], PositionVelocityYawStateStamped, self._on_state)

    def _on_reference(self, message):
        s = message.state
        self._x_ref = np.array([s.x, s.y, s.z, s.x_dot, s.y_dot, s.z_dot, 0.0])

    def _on_state(self, message):
        if self._x_ref is None:
            return
        s = message.state
        error = np.array([s.x, s.y, s.z, s.x_dot, s.y_dot, s.z_dot, s.yaw]) - self._x_ref
        turn = np.array([[math.cos(s.yaw), math.sin(s.yaw)], [-math.sin(s.yaw), math.cos(s.yaw)]])
        error[0:2] = turn @ error[0:2]
        error[3:5] = turn @ error[3:5]
        error[6] = math.remainder(error[6], 2.0 * math.pi)
        answer = ControlStamped()
        answer.header.stamp = rospy.Time.now()
        u = self._u_ref + self._K @ error
        control = answer.control
        control.roll, control.pitch, control.yaw_dot, control.thrust = u.tolist()
        self._publisher.publish(answer)


rospy.init_node("lqr_controller")
Controller()
rospy.spin()
