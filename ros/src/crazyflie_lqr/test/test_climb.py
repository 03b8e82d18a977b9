"""The reference of a climb: how far ahead of the vehicle, and how fast it changes."""

import pytest

from crazyflie_lqr.linear_feedback import ACCELERATION, LEAD, SPEED, Climb


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


def test_the_reference_climbs_by_its_acceleration_up_to_its_speed():
    climb = Climb(3.0)
    climb.advance(0.0, 0.2, 0.0, 1.2, 0.0)
    assert (climb.z, climb.z_dot, climb.z_ddot) == (0.2, 0.0, 0.0)
    climb.advance(0.1, 0.2, 0.0, 1.2, 0.0)
    # 0.5 m/s^2 for 0.1 s.
    assert (climb.z, climb.z_dot, climb.z_ddot) == pytest.approx((0.205, 0.05, 0.5))
    before = climb.z, climb.z_dot, climb.z_ddot
    climb.advance(0.0, 0.2, 0.0, 1.2, 0.0)
    assert (climb.z, climb.z_dot, climb.z_ddot) == before
    for _ in range(8):
        climb.advance(0.1, climb.z, climb.z_dot, 2.2, 0.0)
    # 0.4 m/s after 0.8 s; then as fast for another 0.1 s.
    assert (climb.z_dot, climb.z_ddot) == pytest.approx((0.4, 0.0))
    assert climb.z == pytest.approx(0.2 + 0.1 * (0.05 * sum(range(9)) + 0.4))


def test_it_brakes_to_stop_at_the_goal():
    climb = Climb(3.0)
    climb.advance(0.0, 0.0, 0.4, 0.09, 0.0)
    climb.advance(0.1, 0.0, 0.4, 0.09, 0.0)
    # At 0.3 m/s and with 0.5 m/s^2 it stops within 0.09 m.
    assert (climb.z, climb.z_dot, climb.z_ddot) == pytest.approx((0.03, 0.3, -1.0))
    climb.advance(0.3, 0.1, 0.3, 0.09, 0.0)
    assert (climb.z, climb.z_dot, climb.z_ddot) == (0.09, 0.0, 0.0)


def test_the_disturbance_is_what_the_speed_differs_by():
    climb = Climb(0.5)
    climb.advance(9.0, 0.0, 0.0, 1.0, 9.0)
    assert climb.disturbance == 0.0
    # Commanded were 0.4 m/s^2 more than to hover, for 0.1 s; of the 0.04 m/s only 0.01 came.
    climb.advance(0.1, 0.0, 0.01, 1.0, 0.4)
    assert climb.disturbance == pytest.approx(3.0 * (0.01 - 0.04))
    climb.advance(0.1, 0.0, 0.01, 1.0, 0.0)
    assert climb.disturbance == pytest.approx(-0.09 + 3.0 * 0.009)
    climb.advance(0.1, 0.0, 5.0, 1.0, 0.0)
    assert climb.disturbance == 0.5
    climb.set_limit(0.2)
    assert climb.disturbance == 0.2
    climb.advance(0.1, 0.0, -5.0, 1.0, 0.0)
    assert climb.disturbance == -0.2


@pytest.mark.parametrize(
    ("z", "z_dot", "has_arrived"),
    [
        (0.451, 0.099, True),
        (0.449, 0.0, False),
        (0.451, -0.1, False),
        (0.451, 0.1, False),
        (0.7, 0.3, True),
    ],
)
def test_it_has_arrived_when_the_vehicle_is_there_slowly_or_above(z, z_dot, has_arrived):
    climb = Climb(0.0)
    for _ in range(5):
        climb.advance(0.25, 0.5, 0.0, 0.5, 0.0)
    climb.advance(0.01, z, z_dot, 0.5, 0.0)
    assert climb.has_arrived == has_arrived


def test_it_lasts_a_second_also_where_there_is_no_way_to_go():
    climb = Climb(1.0)
    arrived = []
    for _ in range(8):
        climb.advance(0.125, 0.5, 0.0, 0.5, 0.0)
        arrived.append(climb.has_arrived)
    assert arrived == [False] * 7 + [True]
