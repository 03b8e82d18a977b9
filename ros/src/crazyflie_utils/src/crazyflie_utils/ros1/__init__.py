"""The interface to rospy."""
