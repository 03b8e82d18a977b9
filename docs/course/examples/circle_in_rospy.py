"""Publishes velocities of a circle with plain rospy, until Ctrl-C."""

import contextlib
import sys

import rospy
from geometry_msgs.msg import Twist

rospy.init_node("circle_in_rospy")
speed = rospy.get_param("~speed", 0.3)  # m/s, ahead
radius = rospy.get_param("~radius", 0.5)  # m
if radius <= 0.0:
    rospy.logfatal(f"radius is {radius}; expected a number > 0 (m)")
    sys.exit(1)
publisher = rospy.Publisher("/cmd_vel", Twist, queue_size=1)
twist = Twist()
twist.linear.x = speed
twist.angular.z = -speed / radius  # rad/s, to the right
rospy.loginfo(f"a circle of {radius} m at {speed} m/s")
rate = rospy.Rate(10)  # a second
with contextlib.suppress(rospy.ROSInterruptException):  # Ctrl-C while it sleeps
    while not rospy.is_shutdown():
        publisher.publish(twist)
        rospy.logdebug_throttle(1.0, "still publishing")
        rate.sleep()
