"""Files of trajectories, and their summary."""

import math
from pathlib import Path

import numpy as np
import pytest

from crazyflie_demo.trajectory_file import COLUMNS, TrajectoryError, load, save, summary
from crazyflie_model.polynomials import PolynomialPiece, hermite

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
    coefficients = np.random.default_rng(1).normal(size=(4, 8))
    save(path, [PolynomialPiece(2.5, *coefficients)])
    (piece,) = load(path)
    assert piece.duration == 2.5
    np.testing.assert_allclose(piece.axes, coefficients, rtol=1e-8)


def test_a_file_in_the_home_folder_is_written(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    save("~/flight.csv", [PolynomialPiece(2.5, *np.zeros((4, 8)))])
    assert load(tmp_path / "flight.csv")[0].duration == 2.5


def test_a_heading_empty_lines_and_a_last_comma_do_not_matter(path):
    write(path, ["Duration", "x^0"], [], [*LINE, ""], ["  "], [" 2.0 ", *LINE[1:]])
    assert [piece.duration for piece in load(path)] == [1.5, 2.0]


@pytest.mark.parametrize(
    ("lines", "reason"),
    [
        ([], "no pieces"),
        ([LINE, LINE[:-1]], "line 2 has 32 columns; expected 33"),
        ([[*LINE, "0"]], "line 1 has 34 columns"),
        ([LINE, ["one", *LINE[1:]]], "line 2: 'one' is not a finite number"),
        ([[*LINE[:-1], "nan"]], "line 1: 'nan'"),
        ([[*LINE[:-1], "inf"]], "line 1: 'inf'"),
        ([["0", *LINE[1:]]], "line 1: the duration is 0"),
        ([["-1", *LINE[1:]]], "line 1: the duration is -1"),
        ([LINE, ["1", "0.5", *LINE[2:]]], "piece 1 begins 0.5 (m or rad) from where piece 0 ends"),
    ],
)
def test_a_bad_file_is_refused(path, lines, reason):
    assert reason in refusal(write(path, *lines))


@pytest.mark.parametrize(
    ("first", "reason"),
    [
        (["1_5", *LINE[1:]], "line 1: '1_5' is not a finite number"),
        (["nan", *LINE[1:]], "line 1: 'nan' is not a finite number"),
        (["٣", *LINE[1:]], "line 1: '٣' is not a finite number"),
        ([*LINE[:-1], "7" * 1000], "line 1: '777"),
        ([*LINE[:-1], "x" * 1000], "line 1: 'xxx"),
        ([*LINE[:-1], "x" * 200_000], "line 1: field larger than field limit"),
        ([*LINE[:-1], '"' + "x" * 200_000], "line 1: field larger than field limit"),
    ],
    ids=map(str, range(7)),
)
def test_a_first_line_with_numbers_is_no_heading(path, first, reason):
    text = refusal(write(path, first, LINE))
    assert reason in text
    assert len(text) < len(str(path)) + 200


def test_a_field_that_is_too_long_is_told_with_its_line(path):
    text = refusal(write(path, ["duration"], LINE, ["x" * 200_000]))
    assert f"{path}, line 3: field larger than field limit" in text


def test_lines_are_counted_as_editors_do(path):
    path.write_text('duration,"two\nlines"\n' + ",".join(LINE) + "\n1\n")
    assert "line 4 has 1 columns" in refusal(path)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"duration\n\nStra\xdfe\n", ", line 3: is not text in UTF-8"),
        (b"duration\n1,\0\n", ", line 2: has a NUL"),
    ],
)
def test_bytes_that_are_no_text_are_told_with_their_line(path, content, reason):
    path.write_bytes(content)
    assert f"{path}{reason}" in refusal(path)


def test_a_byte_order_mark_does_not_hide_the_first_piece(path):
    line = ",".join(LINE)
    path.write_bytes(f"\ufeff{line}\r\n{line}\r\n".encode())
    assert len(load(path)) == 2


def test_a_file_that_is_not_there_is_refused(path):
    assert "cannot be read: No such file" in refusal(path)
    with pytest.raises(TrajectoryError, match="null byte"):
        load("a\0.csv")
    with pytest.raises(TrajectoryError, match="File name too long") as error:
        load("a" * 200_000)
    assert len(str(error.value)) < 300


def test_a_summary_of_a_circle():
    # A circle of 1 m once around in 2 pi s, in pieces: 1 m/s and 1 m/s^2 throughout.
    def jet(time):
        s, c = math.sin(time), math.cos(time)
        return np.array([c, -s, -c, s]), np.array([s, c, -s, -c])

    duration = 2.0 * math.pi / 8.0
    pieces = []
    for number in range(8):
        begin, end = jet(number * duration), jet((number + 1) * duration)
        x, y = (hermite(a, b, duration) for a, b in zip(begin, end, strict=True))
        pieces.append(PolynomialPiece(duration, x, y, (), ()))
    assert summary(pieces) == pytest.approx((2.0 * math.pi, 1.0, 1.0), rel=1e-4)
