"""Who waits so that no two vehicles meet, and the ways they are led along."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_fleet.separation import LOOK_AHEAD, Separation

STILL = np.zeros((2, 3))
APART = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 1.0]])
CLOSE = np.array([[0.0, 0.0, 1.0], [0.0, 0.25, 1.0]])


def waiting(positions, velocities, goals, buffers=(0.15, 0.15)):
    waits, pairs = Separation(buffers).update(*map(np.array, (positions, velocities, goals)))
    return waits.tolist(), [(pair.first, pair.second) for pair in pairs]


def test_vehicles_that_are_apart_go_where_they_want():
    assert waiting(APART, STILL, APART[::-1]) == ([False, False], [])


def test_who_is_led_nearer_waits():
    assert waiting(CLOSE, STILL, [CLOSE[1], [0.0, 1.0, 1.0]]) == ([True, False], [(0, 1)])
    assert waiting(CLOSE, STILL, [CLOSE[1], CLOSE[0]]) == ([True, True], [(0, 1)])


def test_a_pair_has_its_distance_and_the_least_one():
    below = [CLOSE[0], [0.0, 0.1, 1.2]]
    _, (pair,) = Separation((0.1, 0.2)).update(np.array(below), STILL, CLOSE)
    assert pair == (0, 1, pytest.approx(np.hypot(0.1, 0.1)), pytest.approx(0.3))


def test_without_a_reference_no_vehicle_is_held():
    assert waiting(CLOSE, STILL, CLOSE) == ([False, False], [(0, 1)])


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize(("climb", "is_held"), [(-3.8, True), (-4.2, False)])
def test_a_way_past_a_vehicle_above_counts_heights_for_half(axis, climb, is_held):
    # 0.2 m aside and 0.2 m up, which is as 0.1 m: 4 m down make up for 1 m aside.
    aside, up = np.eye(3)[axis], np.eye(3)[2]
    places = np.array([np.zeros(3), 0.2 * aside + 0.2 * up])
    way = aside + climb * up
    assert waiting(places, STILL, places + [way, -way])[0] == [is_held] * 2


def test_a_pair_may_part():
    assert waiting(CLOSE, STILL, [[0.0, -1.0, 1.0], [0.0, 1.0, 1.0]])[0] == [False, False]


def test_speed_counts():
    towards = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    near = np.array([[0.0, 0.0, 1.0], [0.0, 0.29 + 2.0 * LOOK_AHEAD, 1.0]])
    assert waiting(near, towards, near[::-1])[0] == [True, True]
    assert waiting(near, STILL, near[::-1])[0] == [False, False]


def test_who_waits_goes_on_only_with_some_more_distance():
    separation = Separation([0.15, 0.15])
    wanted = CLOSE[::-1]
    assert separation.update(CLOSE, STILL, wanted)[0].all()
    just_apart = np.array([[0.0, 0.0, 1.0], [0.0, 0.31, 1.0]])
    assert waiting(just_apart, STILL, just_apart[::-1])[0] == [False, False]
    assert separation.update(just_apart, STILL, just_apart[::-1])[0].all()
    far_enough = np.array([[0.0, 0.0, 1.0], [0.0, 0.34, 1.0]])
    assert not separation.update(far_enough, STILL, far_enough[::-1])[0].any()


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_who_is_not_seen_is_not_regarded(axis):
    unseen = CLOSE.copy()
    unseen[1, axis] = np.nan
    assert waiting(unseen, STILL, CLOSE[::-1]) == ([False, False], [])


COORDINATE = st.floats(-3.0, 3.0)
PLACE = st.tuples(COORDINATE, COORDINATE, COORDINATE)


@given(st.lists(st.tuples(PLACE, PLACE), min_size=2, max_size=8))
def test_no_reference_leads_nearer_to_a_vehicle_that_is_too_close(rows):
    positions, goals = (np.array(part) for part in zip(*rows, strict=True))
    waits, _ = waiting(positions, np.zeros_like(positions), goals, [0.4] * len(rows))
    scale = np.array([1.0, 1.0, 0.5])
    for i in range(len(rows)):
        for j in range(len(rows)):
            between = (positions[j] - positions[i]) * scale
            leads_nearer = (goals[i] - positions[i]) * scale @ between > 1e-9
            if i != j and np.linalg.norm(between) < 0.8 - 1e-9 and leads_nearer:
                assert waits[i]
