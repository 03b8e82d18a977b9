"""ROS driver for Crazyflies."""
