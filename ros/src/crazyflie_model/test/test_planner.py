"""What the planner flies, against its conditions."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

from crazyflie_model.planner import smooth_piece, spiral_piece, straight_piece
from crazyflie_model.polynomials import Goal

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
"""Part of the greater radius that the firmware's polynomial is beside the spiral, in the middle of
a quarter of a turn that begins or ends on the axis: it has no jerk at its ends, and a spiral has.
Found by calculation: 0.01755, and less for all other radii and angles."""


def on_spiral(start, angle, radii, ascent, sideways, clockwise, s):
    """Return where a spiral is at a part of its way, as a complex number, height and yaw."""
    heading = np.exp(1j * start.yaw)
    sense = -1 if clockwise else 1
    # From where it begins the axis is to the left or behind; clockwise to the right or ahead.
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
