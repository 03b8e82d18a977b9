"""First nodes, in plain rospy."""
