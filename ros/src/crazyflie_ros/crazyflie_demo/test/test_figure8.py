"""The figure eight is closed, smooth, gentle, and is what its script makes."""

from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from crazyflie_demo.figure8 import DURATION, HEIGHT, RAMP, WIDTH, figure8, phase, sine
from crazyflie_demo.trajectory_file import load, summary

FILE = Path(__file__).parents[1] / "data" / "figure8.csv"
PIECES = load(FILE)
ROUNDING = 1e-5
"""Of the coefficients in the file and the derivatives that come of them."""


def derivatives(piece, time):
    """Return x, y, z and yaw (columns) and their first three derivatives at a time, s."""
    polynomials = [Polynomial(axis) for axis in piece.axes]
    rows = [[p.deriv(order)(time) for p in polynomials] for order in (1, 2, 3)]
    return np.array([[p(time) for p in polynomials], *rows])


def test_the_file_is_what_the_script_makes():
    made = figure8()
    assert [piece.duration for piece in PIECES] == [piece.duration for piece in made]
    for one, two in zip(PIECES, made, strict=True):
        np.testing.assert_allclose(one.axes, two.axes, atol=1e-8)


def test_begins_and_ends_at_rest_in_the_origin():
    np.testing.assert_allclose(derivatives(PIECES[0], 0.0), 0.0, atol=ROUNDING)
    last = PIECES[-1]
    np.testing.assert_allclose(derivatives(last, last.duration), 0.0, atol=ROUNDING)


def test_is_smooth_up_to_the_jerk():
    for one, two in zip(PIECES, PIECES[1:], strict=False):
        np.testing.assert_allclose(
            derivatives(one, one.duration), derivatives(two, 0.0), atol=ROUNDING
        )


def test_lies_on_the_curve():
    # y^2 = (2 HEIGHT)^2 s^2 (1 - s^2) with s = x / WIDTH: no time in it.
    times = np.linspace(0.0, 1.0, 50)
    for piece in PIECES:
        goal = piece.evaluate(times)
        x, y, z = goal.position
        s = x / WIDTH
        np.testing.assert_allclose(y**2, 4.0 * HEIGHT**2 * s**2 * (1.0 - s**2), atol=1e-4)
        assert not z.any()
        assert not goal.yaw.any()


def test_goes_round_both_loops():
    times = np.linspace(0.0, 1.0, 50, endpoint=False)
    x, y, _ = np.hstack([piece.evaluate(times).position for piece in PIECES])
    assert [x.max(), -x.min()] == pytest.approx([WIDTH] * 2, rel=1e-3)
    assert [y.max(), -y.min()] == pytest.approx([HEIGHT] * 2, rel=1e-3)
    # Ahead around one loop, then around the other: x changes its sign once.
    signs = np.sign(x[np.abs(x) > 0.01])
    assert np.count_nonzero(np.diff(signs)) == 1


def test_is_gentle():
    asked = summary(PIECES)
    assert asked.duration == pytest.approx(10.0)
    assert asked.speed < 0.9
    assert asked.acceleration < 1.0


@pytest.mark.parametrize("function", [phase, lambda time: sine(0.5, 2, time)])
def test_the_derivatives_are_those_of_the_values(function):
    step = 1e-5
    for time in np.linspace(step, DURATION - step, 101):
        # Where the ramp begins and ends, the third derivative has a corner.
        if min(abs(time - RAMP), abs(time - DURATION + RAMP)) < 2.0 * step:
            continue
        slope = (function(time + step) - function(time - step)) / (2.0 * step)
        np.testing.assert_allclose(slope[:3], function(time)[1:], atol=1e-6)
