"""Transforms, and how a process hears them."""

import math

import genpy
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from tf2_msgs.msg import TFMessage


def transform(parent, child, time, x=0.0, yaw=0.0):
    """Return a transform by ``x`` along x, then ``yaw`` about z."""
    message = TransformStamped()
    message.header.frame_id = parent
    message.header.stamp = genpy.Time.from_sec(time)
    message.child_frame_id = child
    message.transform.translation = Vector3(x, 0.0, 0.0)
    message.transform.rotation = Quaternion(0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0))
    return message


def hear(process, *transforms, topic="/tf"):
    process.publish(topic, TFMessage(list(transforms)))


def x_of(lookup):
    return lookup("world", "crazyflie").transform.translation.x
