"""What a Crazyflie is, without ROS: constants, limits, conventions, dynamics, inner loops."""
