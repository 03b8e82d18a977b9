"""Lists of waypoints, and the way along them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_demo.waypoint_node import Demo1Node, Demo2Node, DemoNode
from crazyflie_demo.waypoints import WAYPOINTS, Waypoint, WaypointFollower

A = Waypoint(0.0, 0.0, 1.0, 0.0, 2.0)
B = Waypoint(1.0, 0.0, 1.0, 1.0, 0.0)
C = Waypoint(1.0, 1.0, 1.0, 0.0, 1.0)
TOLERANCES = (0.3, 0.2)


def follower(*waypoints):
    return WaypointFollower(list(waypoints))


@pytest.mark.parametrize(
    "value",
    [
        [],
        "0 0 1 0 1",
        {"x": 1},
        [[0, 0, 1, 0]],
        [[0, 0, 1, 0, 1, 1]],
        [A, 5],
        [[0, 0, "high", 0, 1]],
        [[0, 0, math.nan, 0, 1]],
        [[0, math.inf, 1, 0, 1]],
        [[0, 0, 1, 0, -1]],
        [[0, 0, True, 0, 1]],
    ],
)
def test_a_bad_list_is_refused(value):
    with pytest.raises(ValueError):
        WAYPOINTS(value)


def test_says_which_waypoint_is_bad():
    with pytest.raises(ValueError, match=r"waypoint 1 is \[0, 0, 1, 0, -2\]"):
        WAYPOINTS([[0, 0, 1, 0, 2], [0, 0, 1, 0, -2]])


def test_a_good_list():
    assert WAYPOINTS([[0, 0, 1, 0, 2], [1.5, -2, 1, 3.1, 0]]) == [
        Waypoint(0.0, 0.0, 1.0, 0.0, 2.0),
        Waypoint(1.5, -2.0, 1.0, 3.1, 0.0),
    ]


def test_goes_on_when_it_has_been_there_long_enough():
    path = follower(A, B, C)
    path.update(0.0, (0.0, 0.0, 0.0), 0.0, TOLERANCES)
    path.update(100.0, (0.0, 0.0, 0.69), 0.0, TOLERANCES)
    assert path.goal == A
    path.update(101.0, (0.0, 0.0, 0.71), 0.0, TOLERANCES)
    path.update(102.9, (0.0, 0.0, 1.0), 0.0, TOLERANCES)
    assert path.goal == A
    path.update(103.0, (0.0, 0.0, 1.0), 0.0, TOLERANCES)
    assert path.goal == B


def test_the_seconds_pass_also_when_it_drifts():
    path = follower(A, B)
    path.update(0.0, A[:3], 0.0, TOLERANCES)
    path.update(2.0, (0.4, 0.0, 1.0), 0.0, TOLERANCES)
    assert path.goal == B


def test_the_heading_counts_and_goes_round():
    path = follower(Waypoint(0.0, 0.0, 1.0, math.pi, 0.0), B)
    path.update(0.0, (0.0, 0.0, 1.0), 0.0, TOLERANCES)
    assert path.index == 0
    path.update(1.0, (0.0, 0.0, 1.0), -math.pi + 0.1, TOLERANCES)
    assert path.index == 1


def test_the_last_one_stays():
    path = follower(B, C)
    path.update(0.0, B[:3], 1.0, TOLERANCES)
    path.update(1.0, C[:3], 0.0, TOLERANCES)
    assert (path.goal, path.is_finished) == (C, False)
    path.update(2.0, C[:3], 0.0, TOLERANCES)
    assert (path.goal, path.is_finished) == (C, True)
    path.update(9.0, A[:3], 0.0, TOLERANCES)
    assert (path.goal, path.is_finished) == (C, True)


coordinates = st.floats(-3.0, 3.0)
waypoints = st.builds(
    Waypoint, coordinates, coordinates, coordinates, coordinates, st.floats(0.0, 2.0)
)


@given(st.lists(waypoints, min_size=1, max_size=6))
def test_who_is_always_at_the_goal_ends_after_all_seconds(path):
    followed = follower(*path)
    time, step = 0.0, 0.1
    while not followed.is_finished:
        followed.update(time, followed.goal[:3], followed.goal.yaw, TOLERANCES)
        time += step
        # Each waypoint may take one step more than its seconds, and one to arrive.
        assert time <= sum(w.seconds for w in path) + 2.0 * step * len(path) + 1e-6
    assert followed.index == len(path) - 1


@pytest.mark.parametrize("node", [DemoNode, Demo1Node, Demo2Node])
def test_the_waypoints_of_the_demos_are_in_a_room(node):
    assert WAYPOINTS([list(waypoint) for waypoint in node.waypoints]) == list(node.waypoints)
    for x, y, z, _, _ in node.waypoints:
        assert max(abs(x), abs(y)) <= 1.0
        assert 0.3 <= z <= 1.0


def test_the_two_vehicles_keep_apart_whatever_their_pace():
    def legs(node):
        return zip(node.waypoints, node.waypoints[1:], strict=False)

    nearest = min(
        math.dist(
            [p + s * (q - p) for p, q in zip(a[:3], b[:3], strict=True)],
            [p + t * (q - p) for p, q in zip(c[:3], d[:3], strict=True)],
        )
        for a, b in legs(Demo1Node)
        for c, d in legs(Demo2Node)
        for s in (0.0, 0.25, 0.5, 0.75, 1.0)
        for t in (0.0, 0.25, 0.5, 0.75, 1.0)
    )
    assert nearest >= 1.0
