"""Clients of services, in plain rospy."""
