"""Model of a Crazyflie, without ROS: constants, limits, conventions, dynamics, inner loops."""
