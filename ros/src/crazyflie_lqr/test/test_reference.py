"""What is followed while the source of references fails."""

import numpy as np

from crazyflie_lqr.reference import GuardedReference

GOAL = np.arange(7.0)
HERE = np.array([5.0, 6.0, 7.0, 1.0, 1.0, 1.0, 0.5])
REST_HERE = [5.0, 6.0, 7.0, 0.0, 0.0, 0.0, 0.5]


def followed(reference, time, x=HERE):
    return list(reference.value(time, x))


def test_nothing_before_the_first_good_one():
    reference = GuardedReference(6)
    assert reference.value(0.0, HERE) is None
    reference.bad(1.0)
    assert reference.value(0.0, HERE) is None
    assert reference.value(10.0, HERE) is None


def test_a_good_one_stays_for_ever():
    reference = GuardedReference(6)
    reference.good(GOAL)
    assert followed(reference, 1e6) == list(GOAL)


def test_bad_ones_end_it_after_half_a_second_at_the_place_reached_by_then():
    reference = GuardedReference(6)
    reference.good(GOAL)
    for time in (10.0, 10.2, 10.4):
        reference.bad(time)
    assert followed(reference, 10.49) == list(GOAL)
    assert followed(reference, 10.51) == REST_HERE
    reference.bad(10.6)
    assert followed(reference, 20.0, HERE + 1.0) == REST_HERE


def test_a_good_one_is_followed_again_and_the_next_refuge_is_elsewhere():
    reference = GuardedReference(6)
    reference.good(GOAL)
    reference.bad(10.0)
    assert followed(reference, 11.0) == REST_HERE
    reference.good(2.0 * GOAL)
    assert followed(reference, 12.0) == list(2.0 * GOAL)
    reference.bad(13.0)
    assert followed(reference, 14.0, np.ones(7)) == [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0]
