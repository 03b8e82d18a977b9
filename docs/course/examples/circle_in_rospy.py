"""A publisher with rospy alone: a circle, clockwise."""

import contextlib

import rospy
from geometry_msgs.msg import Twist

rospy.init_node("circle_in_rospy")
publisher = rospy.Publisher("/cmd_vel", Twist, queue_size=1)
twist = Twist()
twist.linear.x = 0.3  # m/s, ahead
twist.angular.z = -0.6  # rad/s, to the right
rate = rospy.Rate(10)  # a second
with contextlib.suppress(rospy.ROSInterruptException):  # Ctrl-C while it sleeps
    while not rospy.is_shutdown():
        publisher.publish(twist)
        rate.sleep()
