"""The velocity of the circle."""

from crazyflie_references.velocity_reference import Velocity
from crazyflie_teleop.velocities import circle_velocity


def test_turns_by_speed_over_radius():
    assert circle_velocity(0.5, 0.3, clockwise=True) == Velocity(x=0.3, yaw_dot=-0.6)
    assert circle_velocity(0.5, 0.3, clockwise=False) == Velocity(x=0.3, yaw_dot=0.6)
