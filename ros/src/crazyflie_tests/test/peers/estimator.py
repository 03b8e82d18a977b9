#!/usr/bin/env python3
"""Position and yaw from tf, velocity from differences, stamped with the time of sending."""

import math

import rospy
import tf2_ros

from crazyflie_msgs.msg import PositionVelocityYawStateStamped


def main():
    """Run until ROS shuts down."""
    rospy.init_node("state_estimator")
    fixed, robot = rospy.get_param("~frames/fixed"), rospy.get_param("~frames/robot")
    publisher = rospy.Publisher(
        rospy.get_param("~topics/state"), PositionVelocityYawStateStamped, queue_size=10
    )
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer)
    rate = rospy.Rate(1.0 / rospy.get_param("~time_step"))
    last = None
    while not rospy.is_shutdown():
        rate.sleep()
        try:
            transform = buffer.lookup_transform(fixed, robot, rospy.Time())
        except tf2_ros.TransformException:
            continue
        stamp = transform.header.stamp.to_sec()
        position = transform.transform.translation
        rotation = transform.transform.rotation
        if last is not None and stamp > last[0]:
            message = PositionVelocityYawStateStamped()
            message.header.stamp = rospy.Time.now()
            state, dt = message.state, stamp - last[0]
            state.x, state.y, state.z = position.x, position.y, position.z
            state.x_dot = (position.x - last[1].x) / dt
            state.y_dot = (position.y - last[1].y) / dt
            state.z_dot = (position.z - last[1].z) / dt
            state.yaw = 2.0 * math.atan2(rotation.z, rotation.w)
            publisher.publish(message)
        if last is None or stamp > last[0]:
            last = (stamp, position)
    listener.unregister()


main()
