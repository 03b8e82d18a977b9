#!/usr/bin/env python3
"""A near-hover vehicle, integrated with Euler steps; publishes /clock as a simulator does."""

import math
import time

import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from rosgraph_msgs.msg import Clock

from crazyflie_msgs.msg import ControlStamped

G = 9.81


def rates(state, control):
    """Return the time derivative of (x, y, z, x_dot, y_dot, z_dot, yaw)."""
    return [
        *state[3:6],
        G * math.tan(control.pitch),
        -G * math.tan(control.roll),
        control.thrust - G,
        control.yaw_dot,
    ]


def main():
    """Run until ROS shuts down."""
    rospy.init_node("simulator")
    dt = rospy.get_param("~time_step")
    pause = dt / rospy.get_param("~clock/real_time_factor")
    state = [float(rospy.get_param(f"~init/{axis}")) for axis in "xyz"] + [0.0] * 4
    controls = []
    rospy.Subscriber(
        rospy.get_param("~topics/control"),
        ControlStamped,
        lambda message: controls.append(message.control),
    )
    broadcaster = tf2_ros.TransformBroadcaster()
    clock = rospy.Publisher("/clock", Clock, queue_size=10)
    now = rospy.Time(1)
    transform = TransformStamped()
    transform.header.frame_id = rospy.get_param("~frames/fixed")
    transform.child_frame_id = rospy.get_param("~frames/robot")
    while not rospy.is_shutdown():
        if controls:
            del controls[:-1]
            state = [
                x + dt * rate for x, rate in zip(state, rates(state, controls[0]), strict=True)
            ]
            if state[2] < 0.0:
                state[2], state[5] = 0.0, max(0.0, state[5])
        now += rospy.Duration(dt)
        transform.header.stamp = now
        position = transform.transform.translation
        position.x, position.y, position.z = state[:3]
        transform.transform.rotation.z = math.sin(state[6] / 2.0)
        transform.transform.rotation.w = math.cos(state[6] / 2.0)
        broadcaster.sendTransform(transform)
        clock.publish(Clock(now))
        time.sleep(pause)


main()
