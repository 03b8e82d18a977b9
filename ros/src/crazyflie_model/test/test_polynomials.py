"""Pieces of trajectories against numpy's polynomials and the layout in memory."""

import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

from crazyflie_model.polynomials import (
    PIECE_SIZE,
    PolynomialPiece,
    at_rest,
    bezier,
    evaluate,
    hermite,
)

NUMBERS = st.floats(-2.0, 2.0)
ENDS = st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS)


def random_piece(seed, duration):
    return PolynomialPiece(duration, *np.random.default_rng(seed).normal(size=(4, 8)).tolist())


@pytest.mark.parametrize("time", [0.0, 0.7, np.linspace(0.0, 2.0, 5)])
def test_evaluation_is_numpys(time):
    piece = random_piece(1, 2.0)
    goal = piece.evaluate(time)
    for i in range(3):
        polynomial = Polynomial(piece.axes[i])
        np.testing.assert_allclose(goal.position[i], polynomial(time), atol=1e-9)
        np.testing.assert_allclose(goal.velocity[i], polynomial.deriv()(time), atol=1e-9)
        np.testing.assert_allclose(goal.acceleration[i], polynomial.deriv(2)(time), atol=1e-9)
    np.testing.assert_allclose(goal.yaw, Polynomial(piece.yaw)(time), atol=1e-9)
    np.testing.assert_allclose(goal.yaw_rate, Polynomial(piece.yaw).deriv()(time), atol=1e-9)


def test_comes_back_from_memory():
    piece = random_piece(2, 1.5)
    assert len(piece.pack()) == PIECE_SIZE
    back = PolynomialPiece.unpack(piece.pack())
    assert back.duration == 1.5
    np.testing.assert_allclose(back.axes, piece.axes, rtol=1e-6)


def test_short_polynomials_are_filled_with_zeros():
    data = PolynomialPiece(2.0, (1.0,), (), (2.0, 3.0), (0.5,)).pack()
    expected = [1.0] + [0.0] * 7 + [0.0] * 8 + [2.0, 3.0] + [0.0] * 6 + [0.5] + [0.0] * 7 + [2.0]
    assert struct.unpack("<33f", data) == tuple(expected)


@pytest.mark.parametrize(("position", "bad"), [(0, math.nan), (31, math.inf), (32, -1.0)])
def test_memory_that_holds_no_piece_is_refused(position, bad):
    numbers = list(struct.unpack("<33f", random_piece(3, 1.0).pack()))
    numbers[position] = bad
    with pytest.raises(ValueError, match="finite"):
        PolynomialPiece.unpack(struct.pack("<33f", *numbers))


@given(ENDS, ENDS, st.floats(0.3, 3.0))
def test_the_polynomial_between_two_ends(start, end, duration):
    polynomial = Polynomial(hermite(start, end, duration))
    assert polynomial.degree() == 7
    orders = [polynomial.deriv(order) if order else polynomial for order in range(4)]
    np.testing.assert_allclose([f(0.0) for f in orders], start, atol=1e-9)
    np.testing.assert_allclose([f(duration) for f in orders], end, atol=1e-5)


@given(ENDS, st.floats(0.3, 3.0), st.floats(0.0, 1.0))
def test_the_bezier_curve_of_control_points(points, duration, s):
    # De Casteljau's construction.
    rest = np.array(points)
    while len(rest) > 1:
        rest = (1.0 - s) * rest[:-1] + s * rest[1:]
    (value,) = evaluate(bezier(points, duration), s * duration, 0)
    assert value == pytest.approx(rest[0], abs=1e-9)


def test_derivatives():
    coefficients = np.random.default_rng(4).normal(size=8).tolist()
    polynomial = Polynomial(coefficients)
    expected = [polynomial(0.7), *(polynomial.deriv(k)(0.7) for k in range(1, 5))]
    np.testing.assert_allclose(evaluate(coefficients, 0.7, 4), expected)


def test_memory_that_was_never_written_is_a_piece_without_duration():
    piece = PolynomialPiece.unpack(bytes(PIECE_SIZE))
    assert piece.duration == 0.0
    assert piece.axes == ([0.0] * 8,) * 4


def test_a_goal_at_rest():
    goal = at_rest((1.0, 2.0, 3.0), 0.5)
    assert goal == ((1.0, 2.0, 3.0), (0.0,) * 3, (0.0,) * 3, 0.5, 0.0)
