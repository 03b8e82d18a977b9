"""The reference that is followed while its source fails."""

import math

import numpy as np
import pytest

from crazyflie_references.governor import ReferenceGovernor

GOAL = np.array([0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 6.0])
HERE = np.array([5.0, 6.0, 7.0, 1.0, 1.0, 1.0, 0.5])
REST_HERE = [5.0, 6.0, 7.0, 0.0, 0.0, 0.0, 0.5]


def followed(reference, time, x=HERE):
    return list(reference.value(time, x))


def test_nothing_before_the_first_valid_one():
    reference = ReferenceGovernor(6)
    assert reference.value(0.0, HERE) is None
    reference.invalidate(1.0)
    assert reference.value(0.0, HERE) is None
    assert reference.value(10.0, HERE) is None


def test_a_valid_one_stays_for_ever():
    reference = ReferenceGovernor(6)
    reference.update(GOAL)
    assert followed(reference, 1e6) == list(GOAL)


def test_invalid_ones_end_it_after_half_a_second_at_a_hold_point():
    reference = ReferenceGovernor(6)
    reference.update(GOAL)
    for time in (10.0, 10.2, 10.4):
        reference.invalidate(time)
    assert followed(reference, 10.49) == list(GOAL)
    assert followed(reference, 10.51) == REST_HERE
    reference.invalidate(10.6)
    assert followed(reference, 20.0, HERE + 1.0) == REST_HERE


def test_a_valid_one_is_followed_again_and_the_next_hold_point_is_elsewhere():
    reference = ReferenceGovernor(6)
    reference.update(GOAL)
    reference.invalidate(10.0)
    assert followed(reference, 11.0) == REST_HERE
    reference.update(2.0 * GOAL)
    assert followed(reference, 12.0) == list(2.0 * GOAL)
    reference.invalidate(13.0)
    assert followed(reference, 14.0, np.ones(7)) == [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0]


# Priority among the sources of references.


def test_an_older_one_does_not_count():
    reference = ReferenceGovernor(6)
    assert reference.update(GOAL, stamp=50.0, now=60.0)
    assert not reference.update(2.0 * GOAL, stamp=49.9, now=60.0)
    assert followed(reference, 60.0) == list(GOAL)
    assert reference.update(3.0 * GOAL, stamp=50.0, now=60.0)
    assert followed(reference, 60.0) == list(3.0 * GOAL)


def test_one_without_a_stamp_counts_always_and_leaves_the_order_of_the_others():
    reference = ReferenceGovernor(6)
    reference.update(GOAL, stamp=50.0, now=60.0)
    assert reference.update(2.0 * GOAL, stamp=0.0, now=60.0)
    assert not reference.update(GOAL, stamp=49.0, now=60.0)
    assert followed(reference, 60.0) == list(2.0 * GOAL)


def test_a_stamp_from_the_future_does_not_shut_the_others_out():
    reference = ReferenceGovernor(6)
    assert reference.update(GOAL, stamp=1000.0, now=60.0)
    assert reference.update(2.0 * GOAL, stamp=60.1, now=60.1)


def test_a_reset_of_the_clock_restarts_the_order():
    reference = ReferenceGovernor(6)
    reference.update(GOAL, stamp=60.0, now=60.0)
    assert reference.update(2.0 * GOAL, stamp=1.0, now=1.0)


def test_a_descent_counts_alone_while_it_is_fresh():
    reference = ReferenceGovernor(6)
    reference.update(GOAL)
    reference.descend(2.0 * GOAL, 10.0)
    reference.update(3.0 * GOAL)
    assert followed(reference, 10.29) == list(2.0 * GOAL)
    reference.descend(4.0 * GOAL, 10.29)
    assert followed(reference, 10.5) == list(4.0 * GOAL)
    assert followed(reference, 10.6) == list(3.0 * GOAL)
    # The clock was reset.
    assert followed(reference, 1.0) == list(3.0 * GOAL)


def test_one_that_was_near_when_it_came_is_not_moved_when_the_vehicle_drifts():
    reference = ReferenceGovernor(6, 3.0)
    near = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    reference.update(near)
    assert followed(reference, 0.0, np.zeros(7)) == near
    assert followed(reference, 1.0, np.full(7, -9.0)) == near


def test_stamps_of_the_first_second_count_also_after_a_reset_of_the_clock():
    reference = ReferenceGovernor(6)
    assert reference.update(GOAL, stamp=0.5, now=2.0)
    assert reference.update(GOAL, stamp=60.0, now=60.0)
    assert reference.update(2.0 * GOAL, stamp=0.5, now=1.0)
    assert not reference.update(GOAL, stamp=0.25, now=1.0)
    assert reference.update(GOAL, stamp=1.0, now=1.0)
    assert not reference.update(GOAL, stamp=0.75, now=1.0)


def test_a_descent_ends_after_three_tenths_of_a_second():
    reference = ReferenceGovernor(6)
    reference.update(GOAL)
    reference.descend(2.0 * GOAL, 0.0)
    assert followed(reference, 0.0) == list(2.0 * GOAL)
    assert followed(reference, 0.29) == list(2.0 * GOAL)
    assert followed(reference, 0.3) == list(GOAL)


# Distant references.

FAR, NEAR = [50.0, -50.0, 1.0, 0.0, 0.0, 0.0, 0.0], [-1.0, 0.5, 1.2, 0.0, 0.0, 0.0, 0.0]
START = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
PERIOD = 0.01


def flown(reference, duration, x=START, begin=0.0, share=1.0, each=lambda time: None):
    """Return the references of a vehicle that goes this share of the way to each of them."""
    course = []
    for k in range(round(duration / PERIOD)):
        time = begin + k * PERIOD
        each(time)
        x_ref = reference.value(time, x)
        x = [a + share * (b - a) for a, b in zip(x, x_ref, strict=True)]
        course.append(x_ref)
    return np.array(course)


def largest_speed(course):
    return np.linalg.norm(np.diff(course[:, :3], axis=0), axis=1).max() / PERIOD


@pytest.mark.parametrize("repeats", [False, True])
def test_a_distant_one_is_travelled_to_at_a_speed_that_is_said_once(repeats):
    reports = []
    reference = ReferenceGovernor(6, 3.0, lambda _, text: reports.append(text))
    goal = [3.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.3]
    reference.update(goal, source="/mission")

    def repeat(time):
        if repeats:
            reference.update(goal, time=time, source="/mission")

    course = flown(reference, 8.0, each=repeat)
    assert list(course[-1]) == goal
    np.testing.assert_array_equal(course[:, 6], 0.3)
    assert 0.95 < largest_speed(course[:-10]) < 1.01
    # The velocity is that of the point, which begins and ends at rest.
    np.testing.assert_allclose(
        np.diff(course[:, :3], axis=0)[:-1], PERIOD * course[1:-1, 3:6], atol=2e-3
    )
    assert np.abs(np.diff(course[:, 3:6], axis=0)).max() < 0.05
    assert reports == ["the reference is 4.2 m away; flying there at 1 m/s"]


def test_the_way_to_a_distant_one_waits_for_the_vehicle():
    reference = ReferenceGovernor(6, 3.0)
    reference.update(FAR)
    course = flown(reference, 20.0, share=0.0)
    ahead = math.dist(course[-1][:3], START[:3])
    assert 0.5 < ahead < 1.0
    assert math.hypot(*course[-1][3:6]) < 0.05
    # It goes on with it.
    course = flown(reference, 20.0, begin=20.0, share=0.05)
    assert math.dist(course[-1][:3], START[:3]) > 15.0


def test_the_way_is_no_faster_than_references_may_be():
    reference = ReferenceGovernor(6, 3.0, max_speed=0.4)
    reference.update(FAR)
    assert largest_speed(flown(reference, 5.0)) < 0.41


def test_a_near_one_ends_the_way_at_once_and_so_do_invalid_ones():
    reference = ReferenceGovernor(6, 3.0)
    reference.update(FAR)
    flown(reference, 2.0)
    reference.update(NEAR, time=2.0)
    assert followed(reference, 2.0, START) == NEAR
    reference.update(FAR, time=3.0)
    reference.invalidate(3.0)
    assert followed(reference, 3.6, START) == START


def test_a_stream_that_comes_near_on_the_way_is_followed():
    reference = ReferenceGovernor(6, 3.0)

    def stream(time):
        reference.update([5.0, 0.5 * time, 1.0, 0.0, 0.5, 0.0, 0.0], time=time)

    course = flown(reference, 6.0, each=stream)
    np.testing.assert_allclose(course[-1][:5], [5.0, 0.5 * 5.99, 1.0, 0.0, 0.5])


@pytest.mark.parametrize("shares", [(0.3, 0.3), (1.0, 0.1), (1.1, 1.1)])
def test_near_ones_of_another_node_do_not_lead_the_vehicle_to_one_far_away(shares):
    """The vehicle flies these shares of the way to the far and to the near ones."""
    reports = []
    reference = ReferenceGovernor(6, 3.0, lambda _, text: reports.append(text))
    x = np.array(START)
    for step in range(200):
        is_far = step % 2
        goal, source = (FAR, "/far") if is_far else (NEAR, "/near")
        reference.update(goal, time=0.1 * step, source=source)
        goal = np.array(reference.value(0.1 * step, x))
        assert math.dist(goal[:3], x[:3]) <= 3.0 + 1e-9
        assert math.dist(goal[:3], NEAR[:3]) <= 3.0 + 1e-9
        x += shares[0 if is_far else 1] * (goal - x)
    assert "another node sends some, too; flying 3 m in its direction" in reports[0]


def test_the_way_begins_when_the_other_node_has_been_silent():
    """As that of a waypoint right after a takeoff, whose hover point is the takeoff server's."""
    reference = ReferenceGovernor(6, 3.0)
    reference.update(START, time=10.0, source="/takeoff_server")
    flown(reference, 0.1, begin=10.0)
    goal = [0.0, 6.0, 1.0, 0.0, 0.0, 0.0, 0.0]
    reference.update(goal, time=11.0, source="/mission")
    course = flown(reference, 3.9, begin=11.0, share=0.1)
    np.testing.assert_allclose(course[-1][:3], [0.0, 3.0, 1.0])
    course = flown(reference, 8.0, x=course[-1], begin=15.0)
    assert list(course[-1]) == goal
    assert largest_speed(course) < 1.01


def test_a_vehicle_carried_away_from_the_last_near_one_flies_towards_one_far_away():
    reference = ReferenceGovernor(6, max_jump=3.0)
    reference.update([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0], source="/a")
    assert followed(reference, 0.0, np.zeros(7))[:3] == [0.0, 0.0, 1.0]
    reference.update([0.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0], source="/b")
    vehicle = [0.0, 20.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(followed(reference, 0.0, vehicle)[:3], [0.0, 23.0, 0.0])


def test_with_another_node_one_that_is_as_far_from_the_last_as_it_may_be_is_another():
    reference = ReferenceGovernor(6, max_jump=3.0)
    goals = []
    for number, (far, here) in enumerate(((50.0, 0.0), (52.5, 3.0), (53.0, 3.0), (-50.0, 3.0))):
        reference.update([0.0] * 7, source="/first" if number == 0 else "")
        reference.update([far, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0], source=f"/{number}")
        goals.append(reference.value(0.0, [here, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])[0])
    np.testing.assert_allclose(goals, [3.0, 3.0, 6.0, 0.0], atol=1e-9)
