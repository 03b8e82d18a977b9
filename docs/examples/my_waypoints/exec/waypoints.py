#!/usr/bin/env python
"""Send the corners of a triangle as references when the vehicle has taken off."""

import rospy
from std_msgs.msg import Empty

from crazyflie_msgs.msg import PositionVelocityStateStamped

CORNERS = [(0.5, 0.0, 1.0), (0.0, 0.5, 1.0), (0.0, 0.0, 1.0)]


def main():
    """Fly."""
    rospy.init_node("waypoints")
    publisher = rospy.Publisher("ref", PositionVelocityStateStamped, queue_size=10)
    rospy.wait_for_message("in_flight", Empty)
    for x, y, z in CORNERS:
        reference = PositionVelocityStateStamped()
        reference.header.stamp = rospy.Time.now()
        reference.state.x, reference.state.y, reference.state.z = x, y, z
        publisher.publish(reference)
        rospy.loginfo("to %g, %g, %g", x, y, z)
        rospy.sleep(4.0)
    rospy.loginfo("arrived")
    rospy.spin()


if __name__ == "__main__":
    main()
