"""The reference that is followed while its source fails."""

import math

import numpy as np
import pytest

from crazyflie_lqr.reference import GuardedReference

GOAL = np.array([0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 6.0])
HERE = np.array([5.0, 6.0, 7.0, 1.0, 1.0, 1.0, 0.5])
REST_HERE = [5.0, 6.0, 7.0, 0.0, 0.0, 0.0, 0.5]


def followed(reference, time, x=HERE):
    return list(reference.value(time, x))


def test_nothing_before_the_first_valid_one():
    reference = GuardedReference(6)
    assert reference.value(0.0, HERE) is None
    reference.invalidate(1.0)
    assert reference.value(0.0, HERE) is None
    assert reference.value(10.0, HERE) is None


def test_a_valid_one_stays_for_ever():
    reference = GuardedReference(6)
    reference.update(GOAL)
    assert followed(reference, 1e6) == list(GOAL)


def test_invalid_ones_end_it_after_half_a_second_at_a_hold_point():
    reference = GuardedReference(6)
    reference.update(GOAL)
    for time in (10.0, 10.2, 10.4):
        reference.invalidate(time)
    assert followed(reference, 10.49) == list(GOAL)
    assert followed(reference, 10.51) == REST_HERE
    reference.invalidate(10.6)
    assert followed(reference, 20.0, HERE + 1.0) == REST_HERE


def test_a_valid_one_is_followed_again_and_the_next_hold_point_is_elsewhere():
    reference = GuardedReference(6)
    reference.update(GOAL)
    reference.invalidate(10.0)
    assert followed(reference, 11.0) == REST_HERE
    reference.update(2.0 * GOAL)
    assert followed(reference, 12.0) == list(2.0 * GOAL)
    reference.invalidate(13.0)
    assert followed(reference, 14.0, np.ones(7)) == [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0]


def test_invalid_ones_also_end_a_distant_one():
    reference = GuardedReference(6, 3.0)
    reference.update([0.0, 50.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    reference.invalidate(10.0)
    assert followed(reference, 10.1, np.zeros(7)) == pytest.approx(
        [0.0, 3.0, 0.06] + [0.0] * 4, abs=0.01
    )
    assert followed(reference, 10.51) == REST_HERE


# Priority among the sources of references.


def test_an_older_one_does_not_count():
    reference = GuardedReference(6)
    assert reference.update(GOAL, stamp=50.0, now=60.0)
    assert not reference.update(2.0 * GOAL, stamp=49.9, now=60.0)
    assert followed(reference, 60.0) == list(GOAL)
    assert reference.update(3.0 * GOAL, stamp=50.0, now=60.0)
    assert followed(reference, 60.0) == list(3.0 * GOAL)


def test_one_without_a_stamp_counts_always_and_leaves_the_order_of_the_others():
    reference = GuardedReference(6)
    reference.update(GOAL, stamp=50.0, now=60.0)
    assert reference.update(2.0 * GOAL, stamp=0.0, now=60.0)
    assert not reference.update(GOAL, stamp=49.0, now=60.0)
    assert followed(reference, 60.0) == list(2.0 * GOAL)


def test_a_stamp_from_the_future_does_not_shut_the_others_out():
    reference = GuardedReference(6)
    assert reference.update(GOAL, stamp=1000.0, now=60.0)
    assert reference.update(2.0 * GOAL, stamp=60.1, now=60.1)


def test_a_reset_of_the_clock_restarts_the_order():
    reference = GuardedReference(6)
    reference.update(GOAL, stamp=60.0, now=60.0)
    assert reference.update(2.0 * GOAL, stamp=1.0, now=1.0)


def test_a_descent_counts_alone_while_it_is_fresh():
    reference = GuardedReference(6)
    reference.update(GOAL)
    reference.descend(2.0 * GOAL, 10.0)
    reference.update(3.0 * GOAL)
    assert followed(reference, 10.29) == list(2.0 * GOAL)
    reference.descend(4.0 * GOAL, 10.29)
    assert followed(reference, 10.5) == list(4.0 * GOAL)
    assert followed(reference, 10.6) == list(3.0 * GOAL)
    # The clock was reset.
    assert followed(reference, 1.0) == list(3.0 * GOAL)


def test_a_distant_one_is_moved_nearer_once():
    reports = []
    reference = GuardedReference(6, 3.0, reports.append)
    x = np.array([1.0, 0.0, 1.0, 0.5, 0.0, 0.0, 0.2])
    reference.update(np.array([1.0, 8.0, 7.0, 1.0, 1.0, 1.0, 0.3]))
    cut = [1.0, 2.4, 2.8, 0.0, 0.0, 0.0, 0.3]
    np.testing.assert_allclose(followed(reference, 0.0, x), cut)
    np.testing.assert_allclose(followed(reference, 1.0, x + 1.0), cut)
    assert reports == ["the reference is 10.0 m away; flying 3 m in its direction"]
    reference.update(np.array([1.0, 2.9, 1.0, 1.0, 0.0, 0.0, 0.3]), time=2.0)
    assert followed(reference, 2.0, x) == [1.0, 2.9, 1.0, 1.0, 0.0, 0.0, 0.3]


def test_one_that_was_near_when_it_came_is_not_moved_when_the_vehicle_drifts():
    reference = GuardedReference(6, 3.0)
    near = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    reference.update(near)
    assert followed(reference, 0.0, np.zeros(7)) == near
    assert followed(reference, 1.0, np.full(7, -9.0)) == near


def test_who_repeats_one_that_is_far_away_does_not_lead_the_vehicle_there():
    reference = GuardedReference(6, max_jump=3.0)
    far = np.array([50.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    vehicle = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    for _ in range(20):
        reference.update(far)
        goal = reference.value(0.0, vehicle)
        np.testing.assert_allclose(goal, [3.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
        vehicle = goal
    reference.update(np.zeros(7))
    assert followed(reference, 0.0, np.zeros(7)) == [0.0] * 7
    reference.update(far)
    np.testing.assert_allclose(reference.value(0.0, np.zeros(7))[:3], [3.0, 0.0, 0.06], atol=0.01)


@pytest.mark.parametrize("shares", [(0.3, 0.3), (1.0, 0.1), (1.1, 1.1)])
def test_near_ones_in_between_do_not_lead_the_vehicle_to_one_far_away(shares):
    """The vehicle flies these shares of the way to the far and to the near ones."""
    reference = GuardedReference(6, max_jump=3.0)
    far, near = [50.0, -50.0, 1.0, 0.0, 0.0, 0.0, 0.0], [-1.0, 0.5, 1.2, 0.0, 0.0, 0.0, 0.0]
    vehicle = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    for step in range(200):
        reference.update(far if step % 2 else near)
        goal = np.array(reference.value(0.0, vehicle))
        assert math.dist(goal[:3], vehicle[:3]) <= 3.0 + 1e-9
        assert math.dist(goal[:3], near[:3]) <= 3.0 + 1e-9
        vehicle += shares[0 if step % 2 else 1] * (goal - vehicle)


def test_a_vehicle_carried_away_from_the_last_near_one_flies_towards_one_far_away():
    reference = GuardedReference(6, max_jump=3.0)
    reference.update([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    assert followed(reference, 0.0, np.zeros(7))[:3] == [0.0, 0.0, 1.0]
    reference.update([0.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    vehicle = [0.0, 20.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(followed(reference, 0.0, vehicle)[:3], [0.0, 23.0, 0.0])


def test_another_one_that_is_far_away_is_another_direction():
    reference = GuardedReference(6, max_jump=3.0)
    reference.update(np.array([50.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert followed(reference, 0.0, np.zeros(7))[:3] == [3.0, 0.0, 0.0]
    reference.update(np.array([-50.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert followed(reference, 0.0, np.zeros(7))[:3] == [-3.0, 0.0, 0.0]


def test_stamps_of_the_first_second_count_also_after_a_reset_of_the_clock():
    reference = GuardedReference(6)
    assert reference.update(GOAL, stamp=0.5, now=2.0)
    assert reference.update(GOAL, stamp=60.0, now=60.0)
    assert reference.update(2.0 * GOAL, stamp=0.5, now=1.0)
    assert not reference.update(GOAL, stamp=0.25, now=1.0)
    assert reference.update(GOAL, stamp=1.0, now=1.0)
    assert not reference.update(GOAL, stamp=0.75, now=1.0)


def test_a_descent_ends_after_three_tenths_of_a_second():
    reference = GuardedReference(6)
    reference.update(GOAL)
    reference.descend(2.0 * GOAL, 0.0)
    assert followed(reference, 0.0) == list(2.0 * GOAL)
    assert followed(reference, 0.29) == list(2.0 * GOAL)
    assert followed(reference, 0.3) == list(GOAL)


def test_one_that_is_as_far_from_the_last_as_it_may_be_is_another():
    reference = GuardedReference(6, max_jump=3.0)
    goals = []
    for far, here in ((50.0, 0.0), (52.5, 3.0), (53.0, 3.0)):
        reference.update([far, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
        goals.append(reference.value(0.0, [here, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])[0])
    np.testing.assert_allclose(goals, [3.0, 3.0, 6.0])
    # One that is 3 m away is near enough.
    reference.update([6.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    assert reference.value(0.0, [3.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])[0] == 6.0
