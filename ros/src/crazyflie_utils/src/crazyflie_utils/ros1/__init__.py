"""The door to rospy."""
