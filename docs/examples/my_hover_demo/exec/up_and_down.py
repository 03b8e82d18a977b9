#!/usr/bin/env python
"""Take off by the driver's services, print the battery's voltage, land."""

import rospy
from std_msgs.msg import Float32

from crazyflie_driver.srv import Land, Takeoff


def main():
    """Fly."""
    rospy.init_node("up_and_down")
    rospy.wait_for_service("/crazyflie/takeoff")
    take_off = rospy.ServiceProxy("/crazyflie/takeoff", Takeoff)
    land = rospy.ServiceProxy("/crazyflie/land", Land)
    take_off(0, 0.5, rospy.Duration(2.0))
    rospy.sleep(4.0)
    rospy.loginfo("%.2f V", rospy.wait_for_message("/crazyflie/battery", Float32).data)
    land(0, 0.0, rospy.Duration(2.0))
    rospy.sleep(3.0)
    rospy.loginfo("landed")


if __name__ == "__main__":
    main()
