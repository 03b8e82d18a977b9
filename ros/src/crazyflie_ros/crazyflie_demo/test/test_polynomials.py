"""Trajectories: files, evaluation, and the polynomial between two ends."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BPoly

from crazyflie_demo.polynomials import (
    COLUMNS,
    Piece,
    TrajectoryError,
    hermite,
    load,
    save,
    summary,
)
from crazyflie_virtual.firmware import polynomials as firmware

FIGURE8 = Path(__file__).parents[1] / "data" / "figure8.csv"
LINE = ["1.5"] + ["0"] * (COLUMNS - 1)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "trajectory.csv"


def write(path, *lines):
    path.write_text("\n".join(",".join(line) for line in lines))
    return path


def refusal(path):
    with pytest.raises(TrajectoryError) as error:
        load(path)
    assert str(path) in str(error.value)
    return str(error.value)


def test_reads_what_it_writes(path):
    rng = np.random.default_rng(1)
    coefficients = rng.normal(size=(4, 8))
    save(path, [Piece(2.5, coefficients)])
    (piece,) = load(path)
    assert piece.duration == 2.5
    np.testing.assert_allclose(piece.coefficients, coefficients, rtol=1e-8)


def test_a_heading_empty_lines_and_a_last_comma_do_not_matter(path):
    write(path, ["Duration", "x^0"], [], [*LINE, ""], ["  "], [" 2.0 ", *LINE[1:]])
    assert [piece.duration for piece in load(path)] == [1.5, 2.0]


@pytest.mark.parametrize(
    ("lines", "reason"),
    [
        ([], "no pieces"),
        ([LINE, LINE[:-1]], "line 2 has 32 columns; expected 33"),
        ([[*LINE, "0"]], "line 1 has 34 columns"),
        ([LINE, ["one", *LINE[1:]]], "line 2: 'one' is no finite number"),
        ([[*LINE[:-1], "nan"]], "line 1: 'nan'"),
        ([[*LINE[:-1], "inf"]], "line 1: 'inf'"),
        ([["0", *LINE[1:]]], "line 1: the duration is 0"),
        ([["-1", *LINE[1:]]], "line 1: the duration is -1"),
        ([LINE, ["1", "0.5", *LINE[2:]]], "piece 1 begins 0.5 (m or rad) from where piece 0 ends"),
    ],
)
def test_a_bad_file_is_refused(path, lines, reason):
    assert reason in refusal(write(path, *lines))


def test_a_file_that_is_not_there_is_refused(path):
    assert "cannot read" in refusal(path)


numbers = st.floats(-2.0, 2.0)


@given(st.lists(numbers, min_size=32, max_size=32), st.floats(0.1, 2.0), st.floats(0.0, 1.0))
def test_evaluates_as_the_firmware_does(values, duration, part):
    coefficients = np.reshape(values, (4, 8))
    piece = Piece(duration, coefficients)
    time = part * duration
    goal = firmware.Piece(tuple(map(tuple, coefficients.tolist())), duration).evaluate(time)
    expected = [
        [*goal.position, goal.yaw],
        [*goal.velocity, goal.yaw_rate],
    ]
    for order in (0, 1):
        np.testing.assert_allclose(piece.evaluate(time, order), expected[order], atol=1e-9)
    np.testing.assert_allclose(piece.evaluate(time, 2)[:3], goal.acceleration, atol=1e-9)


ends = st.lists(numbers, min_size=4, max_size=4).map(np.array)


@given(ends, ends, st.floats(0.3, 3.0))
def test_the_polynomial_between_two_ends(start, end, duration):
    # scipy's, in the form of Bernstein, which comes about quite differently.
    other = BPoly.from_derivatives([0.0, duration], [start, end])
    times = np.linspace(0.0, duration, 20)
    polynomial = np.polynomial.Polynomial(hermite(start, end, duration))
    np.testing.assert_allclose(polynomial(times), other(times), atol=1e-8)


def test_a_summary_of_a_circle():
    # A circle of 1 m once around in 2 pi s, in pieces: 1 m/s and 1 m/s^2 throughout.
    def jet(time):
        s, c = math.sin(time), math.cos(time)
        return np.array([c, -s, -c, s]), np.array([s, c, -s, -c])

    duration = 2.0 * math.pi / 8.0
    pieces = []
    for number in range(8):
        begin, end = jet(number * duration), jet((number + 1) * duration)
        rows = [hermite(a, b, duration) for a, b in zip(begin, end, strict=True)]
        pieces.append(Piece(duration, np.array([*rows, np.zeros(8), np.zeros(8)])))
    assert summary(pieces) == pytest.approx((2.0 * math.pi, 1.0, 1.0), rel=1e-4)
