"""Trajectories of pieces against closed forms and numpy's polynomials."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

from crazyflie_model.planner import straight_piece
from crazyflie_model.polynomials import PolynomialPiece, at_rest
from crazyflie_model.trajectory import (
    MINIMUM_JERK_ACCELERATION,
    MINIMUM_JERK_SPEED,
    Trajectory,
    duration,
    minimum_jerk,
    moved,
    stretched,
    turned,
)

ZERO = (0.0, 0.0, 0.0)
PIECES = [
    PolynomialPiece(span, *np.random.default_rng(seed).normal(size=(4, 8)).tolist())
    for seed, span in enumerate((0.5, 0.8, 0.3))
]


def test_minimum_jerk():
    curve = Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
    s = np.linspace(0.0, 1.0, 1001)
    value, slope = minimum_jerk(s)
    np.testing.assert_allclose(value, curve(s), atol=1e-14)
    np.testing.assert_allclose(slope, curve.deriv()(s), atol=1e-13)
    assert minimum_jerk(0.25) == (value[250], slope[250])
    assert max(slope) == pytest.approx(MINIMUM_JERK_SPEED)
    assert max(curve.deriv(2)(s)) == pytest.approx(MINIMUM_JERK_ACCELERATION, rel=1e-5)


def test_stretched():
    slow = stretched(PIECES, 3.0)
    assert duration(slow) == pytest.approx(3.0 * duration(PIECES))
    now, before = slow[1].evaluate(1.2), PIECES[1].evaluate(0.4)
    np.testing.assert_allclose(now.position, before.position)
    np.testing.assert_allclose(np.multiply(now.velocity, 3.0), before.velocity)
    np.testing.assert_allclose(np.multiply(now.acceleration, 9.0), before.acceleration)


def test_moved_and_turned():
    pieces = turned(moved(PIECES, (1.0, 2.0, 3.0)), (1.0, 2.0, 9.0), math.pi / 2.0)
    for before, after in zip(PIECES, pieces, strict=True):
        was, now = before.evaluate(0.2), after.evaluate(0.2)
        x, y, z = was.position
        np.testing.assert_allclose(now.position, (1.0 - y, 2.0 + x, 3.0 + z))
        np.testing.assert_allclose(now.velocity, np.array(was.velocity)[[1, 0, 2]] * [-1, 1, 1])
        assert now.yaw == pytest.approx(was.yaw + math.pi / 2.0)


def test_a_polynomial_without_coefficients_is_moved():
    (piece,) = moved([PolynomialPiece(1.0, (), (), (), ())], (1.0, 2.0, 3.0))
    assert piece.evaluate(0.5).position == (1.0, 2.0, 3.0)


@given(st.lists(st.floats(-1.0, 4.0), min_size=1), st.booleans(), st.floats(0.5, 2.0))
def test_many_times_are_evaluated_as_each_by_itself(times, backwards, scale):
    trajectory = Trajectory(PIECES, scale, backwards)
    many = trajectory.evaluate(np.array(times))
    for i, time in enumerate(times):
        one = trajectory.evaluate(time)
        for vectors in ("position", "velocity", "acceleration"):
            values = [component[i] for component in getattr(many, vectors)]
            np.testing.assert_allclose(values, getattr(one, vectors), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(
            [many.yaw[i], many.yaw_rate[i]], [one.yaw, one.yaw_rate], atol=1e-9
        )


def line(start, end, duration):
    """Return a piece from one x to another, with a yaw that does the same."""
    goal = at_rest((start, 0.0, 1.0), start)
    return straight_piece(goal, (end, 0.0, 1.0), end, duration)


def test_trajectory_flies_its_pieces_in_order_and_stays_at_the_end():
    trajectory = Trajectory((line(0.0, 1.0, 1.0), line(1.0, 3.0, 1.0)))
    xs = [trajectory.evaluate(t).position[0] for t in (0.0, 0.5, 1.5, 2.0, 9.0)]
    np.testing.assert_allclose(xs, [0.0, 0.5, 2.0, 3.0, 3.0], atol=1e-12)
    assert trajectory.evaluate(1.5).velocity[0] == pytest.approx(2.0)
    assert trajectory.evaluate(9.0).velocity == ZERO


def test_trajectory_scaled_and_backwards():
    trajectory = Trajectory((line(0.0, 1.0, 1.0), line(1.0, 3.0, 1.0)), 2.0, backwards=True)
    assert trajectory.duration == 4.0
    goal = trajectory.evaluate(1.0)
    assert goal.position[0] == pytest.approx(2.0)
    assert goal.velocity[0] == pytest.approx(-1.0)
    assert goal.yaw_rate == pytest.approx(-1.0)


def test_trajectory_moved_and_turned():
    trajectory = Trajectory((line(1.0, 2.0, 1.0),))
    moved = trajectory.moved_to((5.0, 6.0, 7.0), None).evaluate(1.0)
    np.testing.assert_allclose(moved.position, (6.0, 6.0, 7.0), atol=1e-12)
    assert moved.yaw == pytest.approx(2.0)
    # It begins with yaw 1 along x; turned to yaw 1 + pi/2 it goes along y.
    turned = trajectory.moved_to((5.0, 6.0, 7.0), 1.0 + math.pi / 2.0).evaluate(1.0)
    np.testing.assert_allclose(turned.position, (5.0, 7.0, 7.0), atol=1e-12)
    np.testing.assert_allclose(turned.velocity, (0.0, 0.0, 0.0), atol=1e-12)
    assert turned.yaw == pytest.approx(2.0 + math.pi / 2.0)


def test_a_trajectory_that_is_over_is_at_rest():
    trajectory = Trajectory(PIECES)
    end = trajectory.evaluate(1.6)
    assert end[1:3] == (ZERO, ZERO)
    assert end.yaw_rate == 0.0
    np.testing.assert_allclose(end.position, PIECES[-1].evaluate(0.3).position)


def test_turned_by_any_angle():
    pieces = turned(PIECES, (1.0, 2.0, 0.0), 0.5)
    for before, after in zip(PIECES, pieces, strict=True):
        was, now = before.evaluate(0.2).position, after.evaluate(0.2).position
        way = complex(was[0] - 1.0, was[1] - 2.0) * complex(math.cos(0.5), math.sin(0.5))
        np.testing.assert_allclose(now, (1.0 + way.real, 2.0 + way.imag, was[2]))
