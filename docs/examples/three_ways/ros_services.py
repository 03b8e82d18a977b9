#!/usr/bin/env python
"""Two vehicles take off, fly half a metre ahead, and land: by services."""

import rospy
from geometry_msgs.msg import Point
from std_srvs.srv import Empty

from crazyflie_driver.srv import GoTo


def service(name, service_type):
    """Return a service as a function; ROSException if it is not offered within 10 s."""
    rospy.wait_for_service(name, 10.0)
    return rospy.ServiceProxy(name, service_type)


def main():
    """Fly."""
    rospy.init_node("flight")
    take_off, land = service("/all/takeoff", Empty), service("/all/land", Empty)
    go_to = [service(f"/{name}/go_to", GoTo) for name in ("cf1", "cf2")]
    take_off()
    rospy.sleep(6.0)
    for command in go_to:
        command(0, True, Point(0.5, 0.0, 0.0), 0.0, rospy.Duration(3))
    rospy.sleep(4.0)
    land()


if __name__ == "__main__":
    main()
