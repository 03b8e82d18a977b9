"""Buffered Voronoi cells, against their definition."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from crazyflie_model.collision_avoidance import AvoidanceSettings, CollisionAvoidance

RADII = np.array([0.1, 0.1, 0.3])
STILL = np.zeros(3)
OPEN = AvoidanceSettings(tuple(RADII), max_speed=10.0)
NO_STEP = AvoidanceSettings(tuple(RADII), max_speed=10.0, sidestep_threshold=0.0)

COORDINATES = st.floats(-3.0, 3.0)
POINTS = st.tuples(COORDINATES, COORDINATES, COORDINATES).map(np.array)
FAR = POINTS.filter(lambda point: np.linalg.norm(point / RADII) > 2.1)


def slack(point, other):
    """Return how far a point is within the cell about 0, in scaled units; negative outside."""
    to_other = other / RADII
    distance = np.linalg.norm(to_other)
    return distance / 2.0 - 1.0 - (point / RADII) @ to_other / distance


@given(st.lists(FAR, min_size=1, max_size=6), POINTS)
def test_goals_are_moved_to_the_nearest_point_of_the_cell(others, goal):
    avoidance = CollisionAvoidance(NO_STEP)
    found, velocity = avoidance.position_setpoint(STILL, np.array(others), goal, STILL)
    assert min(slack(found, other) for other in others) > -1e-6
    assert np.all(velocity == 0.0)
    constraints = [{"type": "ineq", "fun": slack, "args": (other,)} for other in others]
    best = minimize(
        lambda x: np.sum((x - goal) ** 2), found, constraints=constraints, method="SLSQP"
    )
    assert np.linalg.norm(found - goal) <= math.sqrt(best.fun) + 1e-4


@given(FAR, POINTS, POINTS)
def test_two_in_their_cells_do_not_collide(other, goal, other_goal):
    one, two = CollisionAvoidance(OPEN), CollisionAvoidance(OPEN)
    first, _ = one.position_setpoint(STILL, other[None], goal, STILL)
    second, _ = two.position_setpoint(other, STILL[None], other_goal, STILL)
    assert np.linalg.norm((first - second) / RADII) >= 2.0


def test_a_goal_in_the_cell_stays_as_it_is_and_its_velocity_within_the_wall():
    avoidance = CollisionAvoidance(OPEN)
    others = np.array([[1.0, 0.0, 0.0]])
    goal, velocity = avoidance.position_setpoint(STILL, others, np.array([0.2, 0, 0]), STILL)
    assert goal.tolist() == [0.2, 0.0, 0.0]
    goal = np.array([0.3, 0.0, 0.0])
    _, velocity = avoidance.position_setpoint(STILL, others, goal, np.array([1.0, 0.0, 0.0]))
    # The wall is at 0.5 - 0.1 m.
    assert velocity == pytest.approx([0.1, 0.0, 0.0], abs=1e-5)


def test_a_sidestep_is_to_the_right():
    avoidance = CollisionAvoidance(OPEN)
    others = np.array([[0.24, 0.0, 0.0]])
    goal, _ = avoidance.position_setpoint(STILL, others, np.array([1.0, 0.0, 0.0]), STILL)
    assert goal[0] == pytest.approx(0.02, abs=1e-5)
    # The square of 1 - 0.02 / 0.25.
    assert goal[1] == pytest.approx(-(0.92**2), abs=1e-3)


def test_without_a_cell_a_vehicle_stays_where_it_was_feasible():
    avoidance = CollisionAvoidance(OPEN)
    far, near = np.array([[2.0, 0.0, 0.0]]), np.array([[0.15, 0.0, 0.0], [-0.15, 0.0, 0.0]])
    goal = np.array([0.0, 0.5, 0.0])
    feasible, _ = avoidance.position_setpoint(STILL, far, goal, STILL)
    stay, velocity = avoidance.position_setpoint(STILL, near, np.array([0.0, 2.0, 0.0]), STILL)
    assert stay.tolist() == feasible.tolist() == goal.tolist()
    assert np.all(velocity == 0.0)


def test_a_velocity_leads_back_into_the_cell():
    avoidance = CollisionAvoidance(AvoidanceSettings(tuple(RADII), max_speed=0.5))
    velocity = avoidance.velocity_setpoint(
        STILL, np.array([[0.15, 0.0, 0.0]]), np.array([0.3, 0.0, 0.0])
    )
    # From 0.15 m to 0.2 m apart; each vehicle moves half of the difference.
    assert velocity == pytest.approx([-0.025, 0.0, 0.0], abs=1e-5)


OFF = np.array([0.0, 0.0, 5.0])
ONE = np.array([[1.0, 0.0, 0.0]])


def moving(velocity, others=ONE, **settings):
    """Return the velocity to fly instead of one along x, with radii of 0.1 m."""
    avoidance = CollisionAvoidance(AvoidanceSettings(tuple(RADII), **settings))
    return avoidance.velocity_setpoint(STILL, others, np.array([velocity, 0.0, 0.0])).tolist()


@given(POINTS, POINTS, POINTS)
def test_only_distances_count(origin, other, goal):
    box = {"box_min": (-1.0, -1.5, -0.5), "box_max": (2.0, 1.0, 1.5)}
    near = CollisionAvoidance(AvoidanceSettings(tuple(RADII), **box))
    corners = {name: tuple(origin + corner) for name, corner in box.items()}
    far = CollisionAvoidance(AvoidanceSettings(tuple(RADII), **corners))
    other = other + np.sign(other)
    expected, speed = near.position_setpoint(STILL, other[None], goal, STILL)
    found, same = far.position_setpoint(origin, origin + other[None], origin + goal, STILL)
    np.testing.assert_allclose(found - origin, expected, atol=1e-6)
    np.testing.assert_allclose(same, speed, atol=1e-6)


@pytest.mark.parametrize(
    ("velocity", "found"),
    # In 2 s up to the wall at 0.5 - 0.1 m, and no more than 0.5 m/s without a wall.
    [(0.05, 0.05), (0.5, 0.2), (-0.3, -0.3), (-0.9, -0.5)],
)
def test_a_velocity_ends_at_the_wall_within_the_horizon(velocity, found):
    assert moving(velocity, horizon=2.0) == pytest.approx([found, 0.0, 0.0], abs=1e-5)


def test_a_velocity_is_turned_to_the_right_before_a_wall():
    # The wall is 0.2 m away; the sidestep is the square of 1 - 0.2 / 0.25.
    other = np.array([[0.6, 0.0, 0.0]])
    assert moving(0.1, other) == pytest.approx([0.1, -0.004, 0.0], abs=1e-5)
    assert moving(0.1, other, sidestep_threshold=0.0) == pytest.approx([0.1, 0.0, 0.0])


def test_a_position_within_the_cell_is_not_moved_however_near_the_wall():
    avoidance = CollisionAvoidance(OPEN)
    # The wall is 0.2 m away.
    other, goal = np.array([[0.6, 0.0, 0.0]]), np.array([0.199, 0.0, 0.0])
    assert avoidance.position_setpoint(STILL, other, goal, STILL)[0].tolist() == goal.tolist()


def test_without_a_cell_a_vehicle_does_not_move():
    near = np.array([[0.15, 0.0, 0.0], [-0.15, 0.0, 0.0]])
    assert moving(0.3, near) == [0.0, 0.0, 0.0]
    avoidance = CollisionAvoidance(OPEN)
    stay, velocity = avoidance.position_setpoint(OFF, near + OFF, np.ones(3), np.ones(3))
    assert (stay.tolist(), velocity.tolist()) == (OFF.tolist(), [0.0, 0.0, 0.0])
    # Nor does one that is led to a wall keep its velocity there.
    _, velocity = CollisionAvoidance(OPEN).position_setpoint(STILL, ONE, np.ones(3), np.ones(3))
    assert velocity.tolist() == [0.0, 0.0, 0.0]


def test_a_wall_that_is_flown_along_does_not_count():
    avoidance = CollisionAvoidance(OPEN)
    goal = np.array([0.0, 0.3, 0.0])
    with np.errstate(divide="raise", invalid="raise"):
        found, velocity = avoidance.position_setpoint(STILL, ONE, goal, np.array([0.0, 0.4, 0.0]))
    assert (found.tolist(), velocity.tolist()) == (goal.tolist(), [0.0, 0.4, 0.0])


def test_it_comes_back_into_the_cell_no_faster_than_it_may():
    # From 0.02 m to 0.2 m apart: 0.09 m of it.
    other = np.array([[0.02, 0.0, 0.0]])
    assert moving(0.3, other) == pytest.approx([-0.09, 0.0, 0.0], abs=1e-5)
    assert moving(0.3, other, max_speed=0.05, horizon=4.0) == pytest.approx([-0.05, 0.0, 0.0])
