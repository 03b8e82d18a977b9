"""Numbers, points and boxes at their bounds."""

import math

import numpy as np
import pytest

from crazyflie_mission_api import Bounds, Limits, MissionError
from crazyflie_mission_api.limits import number, point
from crazyflie_model.units import GRAVITY

ROOM = Bounds((-1.0, -2.0, 0.5), (1.0, 2.0, 3.0))


def test_a_box_within_another_is_in_both():
    other = Bounds((-3.0, -0.5, 0.0), (0.5, 5.0, 2.5))
    both = Bounds((-1.0, -0.5, 0.5), (0.5, 2.0, 2.5))
    assert ROOM.within(other) == other.within(ROOM) == both


@pytest.mark.parametrize("axis", range(3))
def test_a_box_has_a_size_along_each_axis(axis):
    upper = list(ROOM.upper)
    upper[axis] = ROOM.lower[axis]
    with pytest.raises(MissionError, match="expected a lower and an upper"):
        Bounds(ROOM.lower, tuple(upper))
    with pytest.raises(MissionError, match="bounds are"):
        Bounds(ROOM.lower[:2], ROOM.upper[:2])


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_positions_are_in_the_box_up_to_its_walls(axis, side):
    inside = np.array([0.0, 0.0, 1.0])
    wall = inside.copy()
    wall[axis] = (ROOM.upper if side > 0.0 else ROOM.lower)[axis]
    ROOM.check(wall, "it")
    ROOM.check(np.array([inside, wall, inside]), "they")
    wall[axis] += 0.001 * side
    for positions in (wall, np.array([inside, wall, inside])):
        with pytest.raises(MissionError, match=f"it is out of bounds: {'xyz'[axis]} is"):
            ROOM.check(positions, "it")


def test_limits_of_thrust_leave_room_to_hover():
    for thrusts in ({"min_thrust": GRAVITY}, {"max_thrust": GRAVITY}):
        with pytest.raises(MissionError, match="expected one below and one above 9.81"):
            Limits(**thrusts)
    Limits(min_thrust=0.99 * GRAVITY, max_thrust=1.01 * GRAVITY)


def test_a_number_may_be_its_minimum_but_not_what_it_must_exceed():
    assert number(2, "it", minimum=2.0) == number(np.float32(2.0), "it", above=1.99) == 2.0
    for value, bounds in (
        (1.99, {"minimum": 2.0}),
        (2.0, {"above": 2.0}),
        (True, {}),
        (math.inf, {}),
        ("2", {}),
    ):
        with pytest.raises(MissionError, match="^it is .*; expected a finite number"):
            number(value, "it", **bounds)


@pytest.mark.parametrize(
    "value", [(1.0, 2.0), (1.0, 2.0, math.inf), "here", None, [[1.0, 2.0, 3.0]]]
)
def test_a_point_has_three_finite_numbers(value):
    np.testing.assert_array_equal(point((1, 2, 3), "goal"), [1.0, 2.0, 3.0])
    with pytest.raises(MissionError, match="^goal is .*; expected x, y, z in m"):
        point(value, "goal")
