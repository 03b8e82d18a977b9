"""What is followed while the source of references fails."""

import numpy as np

from crazyflie_lqr.reference import GuardedReference

GOAL = np.arange(7.0)
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
