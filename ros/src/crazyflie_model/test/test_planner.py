"""The planner's trajectories, against their boundary conditions."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

from crazyflie_model.planner import (
    MAX_ACCELERATION,
    MAX_SPEED,
    braking_time,
    move,
    shortest_duration,
    smooth_piece,
    spiral_piece,
    straight_piece,
)
from crazyflie_model.polynomials import Goal, at_rest
from crazyflie_model.trajectory import Trajectory

ZERO = (0.0, 0.0, 0.0)
NUMBER = st.floats(-3.0, 3.0)
VECTOR = st.tuples(NUMBER, NUMBER, NUMBER)
DURATION = st.floats(0.5, 5.0)


@given(VECTOR, VECTOR, VECTOR, VECTOR, NUMBER, NUMBER, NUMBER, DURATION)
def test_smooth_piece_meets_all_conditions(p, v, a, end, yaw, yaw_rate, end_yaw, duration):
    start = Goal(p, v, a, yaw, yaw_rate)
    piece = smooth_piece(start, end, end_yaw, duration)
    starts = [*zip(p, v, a, strict=True), (yaw, yaw_rate, 0.0)]
    ends = [*end, yaw + math.remainder(end_yaw - yaw, 2.0 * math.pi)]
    for axis, at_start, at_end in zip(piece.axes, starts, ends, strict=True):
        polynomial = Polynomial(axis)
        orders = [polynomial.deriv(order) if order else polynomial for order in range(4)]
        np.testing.assert_allclose([f(0.0) for f in orders], [*at_start, 0.0], atol=1e-9)
        np.testing.assert_allclose([f(duration) for f in orders], [at_end, 0, 0, 0], atol=1e-6)


@given(st.floats(0.0, 1.0), st.floats(0.2, 3.0), DURATION)
def test_takeoff_is_the_documented_polynomial(s, height, duration):
    start = Goal(ZERO, ZERO, ZERO, 0.0, 0.0)
    goal = smooth_piece(start, (0.0, 0.0, height), 0.0, duration).evaluate(s * duration)
    expected = height * (35 * s**4 - 84 * s**5 + 70 * s**6 - 20 * s**7)
    assert goal.position[2] == pytest.approx(expected, abs=1e-9)


@given(VECTOR, VECTOR, DURATION, st.floats(0.0, 1.0))
def test_straight_piece_has_constant_speed(p, end, duration, s):
    start = Goal(p, (1.0, 1.0, 1.0), ZERO, 0.0, 0.0)
    goal = straight_piece(start, end, 0.5, duration).evaluate(s * duration)
    np.testing.assert_allclose(goal.position, (1 - s) * np.array(p) + s * np.array(end), atol=1e-9)
    np.testing.assert_allclose(goal.velocity, (np.array(end) - p) / duration, atol=1e-9)
    assert goal.yaw_rate == pytest.approx(0.5 / duration)


def test_the_turn_is_the_shorter_one():
    start = Goal(ZERO, ZERO, ZERO, 3.0, 0.0)
    assert smooth_piece(start, ZERO, -3.0, 1.0).evaluate(1.0).yaw == pytest.approx(2 * math.pi - 3)


RADIUS = st.floats(0.0, 2.0)

_SPIRAL_ERROR = 0.0176
"""Fraction of the greater radius by which the firmware's polynomial departs from the spiral, in the
middle of a quarter of a turn that begins or ends on the axis: it has no jerk at its ends, and a
spiral has. Found by calculation: 0.01755, and less for all other radii and angles."""


def on_spiral(start, angle, radii, ascent, sideways, clockwise, s):
    """Return where a spiral is at a part of its way, as a complex number, height and yaw."""
    heading = np.exp(1j * start.yaw)
    sense = -1 if clockwise else 1
    # At the start the axis is to the left or behind; clockwise, to the right or ahead.
    to_axis = heading * (-sense if sideways else 1j * sense)
    axis = complex(*start.position[:2]) + radii[0] * to_axis
    radius = (1 - s) * radii[0] + s * radii[1]
    place = axis - radius * to_axis * np.exp(1j * sense * angle * s)
    return place, start.position[2] + s * ascent, start.yaw + sense * angle * s


@pytest.mark.parametrize(
    ("sideways", "clockwise", "x", "y"),
    # As the firmware's plan_spiral_from calculates.
    [(0, 0, 0.5, 0.5), (0, 1, 0.5, -0.5), (1, 0, -0.5, 0.5), (1, 1, 0.5, 0.5)],
)
def test_where_a_quarter_of_a_turn_ends(sideways, clockwise, x, y):
    start = Goal(ZERO, ZERO, ZERO, 0.0, 0.0)
    piece = spiral_piece(start, math.pi / 2, (0.5, 0.5), 0.0, 3.0, sideways, clockwise)
    assert piece.evaluate(3.0).position == pytest.approx((x, y, 0.0))


@given(
    VECTOR,
    NUMBER,
    st.floats(-2.0 * math.pi, 2.0 * math.pi),
    st.tuples(RADIUS, RADIUS),
    NUMBER,
    DURATION,
    st.booleans(),
    st.booleans(),
)
def test_spiral_piece(p, yaw, angle, radii, ascent, duration, sideways, clockwise):
    start = Goal(p, ZERO, ZERO, yaw, 0.0)
    piece = spiral_piece(start, angle, radii, ascent, duration, sideways, clockwise)
    # On a quarter of a turn it is a spiral; on more it still ends as one.
    parts = (0.0, 0.25, 0.5, 0.75, 1.0) if abs(angle) <= math.pi / 2 else (0.0, 1.0)
    for s in parts:
        goal = piece.evaluate(s * duration)
        place, height, heading = on_spiral(start, angle, radii, ascent, sideways, clockwise, s)
        assert abs(complex(*goal.position[:2]) - place) < _SPIRAL_ERROR * max(radii) + 1e-6
        assert goal.position[2] == pytest.approx(height, abs=1e-6)
        assert goal.yaw == pytest.approx(heading, abs=1e-6)
        assert goal.yaw_rate == pytest.approx((-angle if clockwise else angle) / duration, abs=1e-6)
    h = 1e-5
    for s in (0.0, 1.0):
        goal = piece.evaluate(s * duration)
        near = [
            on_spiral(start, angle, radii, ascent, sideways, clockwise, s + d)[0]
            for d in (-h, 0.0, h)
        ]
        velocity = (near[2] - near[0]) / (2 * h * duration)
        assert abs(complex(*goal.velocity[:2]) - velocity) < 1e-3
        acceleration = (near[2] - 2 * near[1] + near[0]) / (h * duration) ** 2
        assert abs(complex(*goal.acceleration[:2]) - acceleration) < 1e-2 * (1 + abs(acceleration))


SPEED = st.floats(-1.0, 1.0)


def sampled(pieces):
    """Return times, and positions, velocities and headings on a trajectory."""
    trajectory = Trajectory(pieces)
    times = np.linspace(0.0, trajectory.duration, 1001)
    goals = [trajectory.evaluate(time) for time in times.tolist()]
    parts = ([goal[k] for goal in goals] for k in (0, 1, 3))
    return (times, *map(np.array, parts))


@given(VECTOR, VECTOR, st.tuples(SPEED, SPEED, SPEED), NUMBER, NUMBER)
def test_a_move_in_flight_is_smooth_and_keeps_the_limits(start, end, velocity, yaw, end_yaw):
    seconds = shortest_duration(math.dist(start, end), math.hypot(*velocity)) + 1e-9
    seconds = max(seconds, 0.1)
    pieces = move(Goal(start, velocity, ZERO, yaw, 0.3), end, end_yaw, seconds)
    times, positions, velocities, yaws = sampled(pieces)
    assert times[-1] == pytest.approx(seconds)
    assert (positions[0], positions[-1]) == (pytest.approx(start), pytest.approx(end, abs=1e-6))
    assert velocities[0] == pytest.approx(velocity)
    assert velocities[-1] == pytest.approx(ZERO, abs=1e-6)
    turn = math.remainder(end_yaw - yaw, 2.0 * math.pi)
    assert (yaws[0], yaws[-1]) == (pytest.approx(yaw), pytest.approx(yaw + turn, abs=1e-6))
    assert np.gradient(positions, times, axis=0)[1:-1] == pytest.approx(velocities[1:-1], abs=2e-3)
    accelerations = np.linalg.norm(np.gradient(velocities, times, axis=0), axis=1)
    assert accelerations.max() <= MAX_ACCELERATION + 0.05
    assert np.linalg.norm(velocities, axis=1).max() <= MAX_SPEED + 1e-6


@given(VECTOR, VECTOR, NUMBER, DURATION)
def test_a_move_from_rest_is_the_firmwares(start, end, yaw, seconds):
    (piece,) = move(at_rest(start, 0.2), end, yaw, seconds)
    assert piece == smooth_piece(at_rest(start, 0.2), end, yaw, seconds)


def test_braking_does_not_take_longer_because_the_move_does():
    start = Goal(ZERO, (1.0, 0.0, 0.0), (0.5, 0.0, 0.0), 0.0, 0.0)
    _, positions, velocities, _ = sampled(move(start, ZERO, 0.0, 60.0))
    assert 0.25 < positions[:, 0].max() < 1.0
    assert braking_time(1.0) == pytest.approx(3.94)
    assert velocities[100] == pytest.approx(ZERO, abs=1e-6)


@pytest.mark.parametrize(
    ("distance", "seconds"),
    # Calculated by hand: 35/16 d / 2 m/s, and sqrt(7.5132 d / 2 m/s^2).
    [(0.5, 1.3705), (1.0, 1.9382), (10.0, 10.9375)],
)
def test_the_shortest_move_keeps_speed_and_acceleration(distance, seconds):
    assert shortest_duration(distance) == pytest.approx(seconds, abs=1e-4)
    times, _, velocities, _ = sampled(move(at_rest(ZERO), (distance, 0.0, 0.0), 0.0, seconds))
    accelerations = np.gradient(velocities[:, 0], times)
    assert velocities.max() <= MAX_SPEED + 1e-3
    assert np.abs(accelerations).max() <= MAX_ACCELERATION + 1e-2
