"""The lead of velocities over the points of references, by hand."""

import math

import pytest

from crazyflie_references.velocity_check import VelocityCheck, limited

ZERO = (0.0, 0.0, 0.0)


def test_a_velocity_leads_for_half_a_second_and_is_forgotten_in_two():
    check = VelocityCheck()
    check.update(ZERO, (0.4, 0.0, 0.0), 10.0)
    assert check._lead == ZERO
    check.update(ZERO, (0.4, 0.0, 0.0), 11.0)
    assert check._lead == pytest.approx((0.2, 0.0, 0.0))
    check.update((0.15, 0.0, 0.0), (0.4, 0.0, 0.0), 12.0)
    lead = 0.2 * math.exp(-0.5) + 0.2 - 0.15
    assert check._lead == pytest.approx((lead, 0.0, 0.0))
    # 0.29 m are 0.1 m more than it led to, and a bit less; with more it jumped.
    check.update((0.15, -0.22, 0.0), ZERO, 12.0)
    assert check._lead == pytest.approx((lead, 0.0, 0.0))
    check.update((0.15, -0.13, 0.0), ZERO, 12.0)
    assert check._lead == pytest.approx((lead, -0.09, 0.0))
    # Time was reset.
    check.update(ZERO, ZERO, 1.0)
    assert check._lead == ZERO


def test_a_lead_of_a_metre_is_the_most():
    check = VelocityCheck()
    counts = [check.update(ZERO, (0.0, 2.0, 0.0), 0.125 * k) for k in range(30)]
    assert counts[:3] == [True] * 3
    assert not any(counts[3:])
    assert check._lead == pytest.approx((0.0, 1.0, 0.0))
    # A reference that leads back is used.
    assert check.update(ZERO, (0.0, -2.0, 0.0), 3.625)


def test_a_vector_is_made_shorter_and_not_longer():
    assert limited((3.0, 0.0, -4.0), 2.5) == [1.5, 0.0, -2.0]
    assert limited((3.0, 0.0, -4.0), 5.0) == [3.0, 0.0, -4.0]
