"""Trajectories through waypoints."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

from crazyflie_mission_api import Limits, MissionError, plan
from crazyflie_mission_api.minimum_snap import _pieces, _snap, best_times
from crazyflie_mission_api.trajectories import demands, duration, excess, sampled
from crazyflie_model.polynomials import hermite

SQUARE = [(0, 0, 1), (1, 0, 1), (1, 1, 1.5), (0, 1, 1), (0, 0, 1)]
LIMITS = Limits(speed=1.0, acceleration=2.0)


def snap(pieces):
    """Return the integral of the squared snap over all axes."""
    total = 0.0
    for piece in pieces:
        for axis in piece.axes:
            squared = (Polynomial(axis).deriv(4) ** 2).integ()
            total += squared(piece.duration) - squared(0.0)
    return total


def test_between_two_points_it_is_the_polynomial_that_rests_at_both():
    (piece,) = plan([(0, 0, 1), (1, 0, 1)], LIMITS)
    expected = hermite((0.0,) * 4, (1.0, 0.0, 0.0, 0.0), piece.duration)
    np.testing.assert_allclose(piece.x, expected, atol=1e-9)


def test_what_is_minimized_is_the_snap_of_the_pieces():
    points = np.array([(*place, 0.1 * place[0]) for place in SQUARE])
    times = np.array([0.0, 0.2, 0.5, 0.6, 1.0])
    assert _snap(points, times) == pytest.approx(snap(_pieces(points, times)), rel=1e-6)


def test_passes_its_waypoints_smoothly_and_rests_at_both_ends():
    pieces = plan(SQUARE, LIMITS)
    for piece, begin, end in zip(pieces, SQUARE, SQUARE[1:], strict=False):
        np.testing.assert_allclose(piece.evaluate(0.0).position, begin, atol=1e-9)
        np.testing.assert_allclose(piece.evaluate(piece.duration).position, end, atol=1e-9)
    for one, two in itertools.pairwise(pieces):
        for a, b in zip(one.axes, two.axes, strict=True):
            # Six derivatives: more than a user asks for, which is the sign of an optimum.
            for order in range(1, 7):
                left = Polynomial(a).deriv(order)(one.duration)
                assert left == pytest.approx(Polynomial(b).deriv(order)(0.0), abs=1e-5)
    for piece, time in ((pieces[0], 0.0), (pieces[-1], pieces[-1].duration)):
        for axis, order in itertools.product(piece.axes, (1, 2, 3)):
            assert Polynomial(axis).deriv(order)(time) == pytest.approx(0.0, abs=1e-7)


def test_a_heading_is_kept_until_another_is_told():
    pieces = plan([(0, 0, 1), (1, 0, 1, 0.5), (2, 0, 1)], LIMITS)
    yaws = [piece.evaluate(0.0).yaw for piece in pieces]
    yaws.append(pieces[-1].evaluate(pieces[-1].duration).yaw)
    assert yaws == pytest.approx([0.0, 0.5, 0.5], abs=1e-9)


def test_no_curve_through_the_same_points_at_the_same_times_has_less_snap():
    pieces = plan(SQUARE, LIMITS)
    # A bump that vanishes, with three derivatives, where one piece begins and ends.
    middle = pieces[1]
    s = Polynomial([0.0, 1.0])
    bump = (s * (middle.duration - s)) ** 4
    for size in (-1e-3, 1e-3):
        other = (Polynomial(middle.x) + size * bump).coef
        changed = [pieces[0], type(middle)(middle.duration, other, *middle.axes[1:]), *pieces[2:]]
        assert snap(changed) > snap(pieces)


def test_the_times_make_the_snap_less_than_even_ones():
    points = np.array([(0, 0, 1, 0), (0.1, 0, 1, 0), (3, 0, 1, 0), (3, 0.2, 1, 0)], dtype=float)
    spans = np.diff(best_times(points))
    assert spans.sum() == pytest.approx(1.0)
    assert spans[1] > spans[2] > spans[0]
    # With even times it swings out by more than half a metre.
    y = sampled(plan(points, LIMITS))[1][0, 1]
    assert -0.25 < y.min()
    assert y.max() < 0.25


@given(
    st.lists(
        st.tuples(*[st.floats(-3.0, 3.0)] * 2, st.floats(0.5, 2.0), st.floats(-3.0, 3.0)),
        min_size=2,
        max_size=5,
    ).filter(lambda w: all(math.dist(a, b) > 0.05 for a, b in itertools.pairwise(w)))
)
def test_whatever_the_waypoints_the_limits_hold(waypoints):
    pieces = plan(waypoints, LIMITS)
    assert excess(pieces, LIMITS) == {}
    # And it is no slower than it must be: at least one limit is nearly reached.
    quicker = Limits(
        **{key: 0.9 * value for key, value in vars(LIMITS).items() if "thrust" not in key}
    )
    assert excess(pieces, quicker) or duration(pieces) < 1.0


def test_tilt_and_thrust_are_limits_too():
    fast = Limits(speed=50.0, acceleration=50.0, yaw_rate=50.0)
    for goal, name in (((9, 0, 1), "tilt"), ((0, 0, 9), "max_thrust")):
        pieces = plan([(0, 0, 1), goal], fast)
        assert excess(pieces, fast) == {}
        reached = demands(sampled(pieces)[1])[name].max()
        assert reached == pytest.approx(getattr(fast, name), rel=0.1)


@pytest.mark.parametrize(
    ("waypoints", "text"),
    [
        ([(0, 0, 1), (0, math.nan, 1)], r"waypoint 2 is \(0, nan, 1\); expected finite numbers"),
        ([(0, 0, 1), (0, 1)], r"waypoint 2 is \(0, 1\)"),
        ([(0, 0, 1), "here"], "waypoint 2 is 'here'"),
        ([(0, 0, 1)], "the number of waypoints is 1; expected at least 2"),
        ([(0, 0, 1), (0, 0, 1)], "waypoint 1 is .*, and 2 is the same"),
    ],
)
def test_bad_waypoints_are_named(waypoints, text):
    with pytest.raises(MissionError, match=text):
        plan(waypoints)
