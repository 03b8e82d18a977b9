"""Calls a service with plain rospy: the vehicle takes off."""

import sys

import rospy
from std_srvs.srv import Empty

rospy.init_node("takeoff_in_rospy")
try:
    rospy.wait_for_service("/takeoff", timeout=10.0)
    takeoff = rospy.ServiceProxy("/takeoff", Empty)
    takeoff()
except (rospy.ROSException, rospy.ServiceException) as error:
    sys.exit(f"no takeoff: {error}")
print("in flight")
