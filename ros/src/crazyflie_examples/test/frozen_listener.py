"""Subscribes to the topics of a flight, and stops without closing the connections."""

import os
import signal
import sys

import rospy
from tf2_msgs.msg import TFMessage

from crazyflie_msgs.msg import ControlStamped, PositionVelocityYawStateStamped
from crazyflie_utils.testing.peer import wait_until

sys.stdin.readline()
rospy.init_node("frozen_listener")
subscribers = [
    rospy.Subscriber(topic, kind, lambda _: None)
    for topic, kind in (
        ("/tf", TFMessage),
        ("/state", PositionVelocityYawStateStamped),
        ("/control/final", ControlStamped),
    )
]
wait_until(lambda: all(each.get_num_connections() for each in subscribers), "all connections")
os.kill(os.getpid(), signal.SIGSTOP)
os._exit(0)
