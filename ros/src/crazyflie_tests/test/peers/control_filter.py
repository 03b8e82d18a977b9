#!/usr/bin/env python3
"""Takeoff control always; commanded control in flight, or when takeoff control has become old."""

import rospy
from std_msgs.msg import Empty

from crazyflie_msgs.msg import ControlStamped


class Filter:
    """Knows of the flight what the toggles say."""

    def __init__(self):
        self._in_flight = False
        self._takeoff_control = None
        self._takeoff_time = None
        topics = rospy.get_param("~topics")
        self._final = rospy.Publisher(topics["final_control"], ControlStamped, queue_size=10)
        rospy.Subscriber(topics["takeoff_control"], ControlStamped, self._on_takeoff_control)
        rospy.Subscriber(topics["commanded_control"], ControlStamped, self._on_commanded_control)
        rospy.Subscriber(topics["in_flight"], Empty, self._on_toggle)

    def _on_toggle(self, _):
        self._in_flight = not self._in_flight

    def _on_takeoff_control(self, message):
        self._takeoff_control, self._takeoff_time = message, rospy.get_time()
        self._final.publish(message)

    def _on_commanded_control(self, message):
        if self._in_flight or self._takeoff_control is None:
            self._final.publish(message)
        elif rospy.get_time() - self._takeoff_time > 0.5:
            self._final.publish(message)
        else:
            self._final.publish(self._takeoff_control)


rospy.init_node("takeoff_control_filter")
Filter()
rospy.spin()
