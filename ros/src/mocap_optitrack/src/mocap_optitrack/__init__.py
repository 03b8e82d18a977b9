"""Motion capture for ROS."""
