"""The reference of a climb: how far ahead of the vehicle, and how fast it changes."""

import pytest

from crazyflie_lqr.climb import ACCELERATION, LEAD, SPEED, Climb


def test_it_waits_for_a_vehicle_that_does_not_lift_off():
    climb = Climb(3.0)
    for _ in range(400):
        climb.advance(0.01, 0.0, 0.0, 1.0, 0.0)
        assert climb.z <= LEAD
    assert climb.z == pytest.approx(LEAD)
    assert not climb.has_arrived


def test_a_goal_that_is_lowered_is_no_step_of_the_acceleration():
    climb = Climb(3.0)
    while climb.z_dot < SPEED:
        climb.advance(0.01, climb.z, climb.z_dot, 2.0, 0.0)
    climb.advance(0.01, climb.z, climb.z_dot, climb.z + 0.01, 0.0)
    assert climb.z_ddot == -2.0 * ACCELERATION
