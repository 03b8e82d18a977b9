#!/usr/bin/env python3
"""Takeoff and landing in the manual's bare way: open loop, one reference, a toggle; no latching."""

import rospy
from std_msgs.msg import Empty
from std_srvs.srv import Empty as EmptyService
from std_srvs.srv import EmptyResponse

from crazyflie_msgs.msg import ControlStamped, PositionVelocityStateStamped

G = 9.81


class TakeoffServer:
    """Two services that return when they are through."""

    def __init__(self):
        topics = rospy.get_param("~topics")
        self._control = rospy.Publisher(topics["control"], ControlStamped, queue_size=10)
        self._reference = rospy.Publisher(
            topics["reference"], PositionVelocityStateStamped, queue_size=10
        )
        self._toggle = rospy.Publisher(topics["in_flight"], Empty, queue_size=10)
        self._is_idle_on_ground = True
        rospy.Timer(rospy.Duration(0.1), self._refresh)
        rospy.Service("/takeoff", EmptyService, self._take_off)
        rospy.Service("/land", EmptyService, self._land)

    def _send(self, thrust):
        message = ControlStamped()
        message.header.stamp = rospy.Time.now()
        message.control.thrust = thrust
        self._control.publish(message)

    def _refresh(self, _):
        if self._is_idle_on_ground:
            self._send(0.0)

    def _take_off(self, _):
        self._is_idle_on_ground = False
        begin = rospy.get_time()
        while rospy.get_time() - begin < 1.0:
            self._send(G + 0.2)
            rospy.sleep(0.01)
        reference = PositionVelocityStateStamped()
        reference.header.stamp = rospy.Time.now()
        for axis in "xyz":
            setattr(reference.state, axis, rospy.get_param(f"~hover/{axis}"))
        self._reference.publish(reference)
        rospy.sleep(5.0)
        self._toggle.publish(Empty())
        return EmptyResponse()

    def _land(self, _):
        self._toggle.publish(Empty())
        begin = rospy.get_time()
        while (elapsed := rospy.get_time() - begin) < 1.0:
            self._send(G - 5.0 * elapsed)
            rospy.sleep(0.01)
        self._is_idle_on_ground = True
        return EmptyResponse()


rospy.init_node("takeoff_server")
TakeoffServer()
rospy.spin()
