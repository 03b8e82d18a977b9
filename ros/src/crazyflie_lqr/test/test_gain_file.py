"""Gain files: what can be read, and the messages about what cannot."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from crazyflie_lqr.gain_file import (
    GainFileError,
    MatrixFile,
    load_matrix,
    load_vector,
    save_matrix,
)


@pytest.fixture
def write(tmp_path):
    """Return a function that writes a file and returns its path."""

    def write(text):
        path = tmp_path / "K.txt"
        path.write_text(text)
        return str(path)

    return write


def test_reads_numbers_before_between_and_after_comments(write):
    path = write("# gains\n\n 1 -2.5\t3e-1 # the first row\n   # more\n4 5 6\n# end\n")
    np.testing.assert_array_equal(load_matrix(path, 2, 3), [[1, -2.5, 0.3], [4, 5, 6]])


@pytest.mark.parametrize("text", ["0 0 0 9.81\n", "0\n0\n# thrust\n0\n9.81", "# hover\n0 0 0 9.81"])
def test_reads_a_vector_as_row_or_column(write, text):
    np.testing.assert_array_equal(load_vector(write(text), 4), [0, 0, 0, 9.81])


def test_reads_vectors_of_one(write):
    np.testing.assert_array_equal(load_vector(write("3\n"), 1), [3.0])


@pytest.mark.parametrize(
    ("text", "line", "reason"),
    [
        ("1 2 3\n4 five 6\n", "line 2", "'five' is not a number"),
        ("# top\n1 2 nan\n4 5 6\n", "line 2", "'nan' is not finite"),
        ("1 2 3\n\n4 5 -inf\n", "line 3", "'-inf' is not finite"),
        ("1 2 3\n4 5\n", "line 2", "2 numbers"),
        ("1 2 3 4\n", "line 1", "4 numbers"),
        ("1, 2, 3\n", "line 1", "'1,' is not a number"),
        ("1 2 3\n4 5 6\n7 8 9\n", "line 3", "row 3"),
        ("1 2 3\n", "line 1", "ends after 1 row"),
        ("# nothing\n", "line 0", "ends after 0 rows"),
        ("\udcff\udcfe", "line 1", "is not a number"),
        ("1 2 3\n4 1_000 6\n", "line 2", "'1_000' is not a number"),
        ("1 2 3\n4 ٥ 6\n", "line 2", "is not a number"),
        ("1 2 3\n4 5 -", "line 2", "'-' is not a number"),
        ("1 2 3\n4 5 1e", "line 2", "'1e' is not a number"),
        ("1 2 3\n4 5 1.5e-", "line 2", "'1.5e-' is not a number"),
        ("1 2 3\n4 5 -1.", "line 2", "the file ends in a number without the digits"),
        ("1 2 3\n4 5", "line 2", "2 numbers"),
        ("1 2 3\n4 5 \0006\n", "line 2", "'\\x006' is not a number"),
        ("1 2 " + "x" * 200_000, "line 1", "xxx' is not a number"),
        ("1 2 1" + "0" * 200_000, "line 1", "000' is not finite"),
    ],
)
def test_a_bad_matrix_is_told_by_file_line_and_shape(tmp_path, text, line, reason):
    path = tmp_path / "K.txt"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(GainFileError) as caught:
        load_matrix(str(path), 2, 3)
    for part in (str(path), line, reason, "expected 2 rows of 3 numbers"):
        assert part in str(caught.value)
    assert len(str(caught.value)) < len(str(path)) + 250


def test_numbers_as_programs_write_them(write):
    path = write("-1. .5 +2e3\r\n1E-3 0x 7.\n".replace("0x", "0"))
    np.testing.assert_array_equal(load_matrix(path, 2, 3), [[-1, 0.5, 2000], [1e-3, 0, 7]])
    np.testing.assert_array_equal(load_vector(write("1 2. # 9."), 2), [1, 2])


@pytest.mark.parametrize(
    ("text", "line", "reason"),
    [
        ("0 0 0\n", "line 1", "3 numbers"),
        ("0 0 0 9.81 0\n", "line 1", "5 numbers"),
        ("0 0 0 9.81\n0 0 0 9.81\n", "line 2", "4 numbers"),
        ("0\n0\n0\n", "line 3", "ends after 3 numbers"),
        ("0\n0\n0 9.81\n", "line 3", "2 numbers"),
        ("0 0\n0 9.81\n", "line 1", "2 numbers"),
        ("0\n0\n0\n9.81\n1\n", "line 5", "1 number"),
        ("", "line 0", "ends after 0 numbers"),
        ("hover\n", "line 1", "'hover' is not a number"),
    ],
)
def test_a_bad_vector_is_told_by_file_line_and_shape(write, text, line, reason):
    path = write(text)
    with pytest.raises(GainFileError) as caught:
        load_vector(path, 4)
    for part in (path, line, reason, "expected 4 numbers in one row or one column"):
        assert part in str(caught.value)


def test_files_are_found_from_home(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    save_matrix("~/K.txt", [[1.0, 2.0]])
    assert MatrixFile(1, 2)("~/K.txt").tolist() == [[1.0, 2.0]]
    with pytest.raises(GainFileError, match=f"{tmp_path}/none.txt: No such file"):
        load_matrix("~/none.txt", 1, 2)


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    with pytest.raises(GainFileError, match=r"none\.txt: No such file.*expected 4 rows of 7"):
        load_matrix(str(tmp_path / "none.txt"), 4, 7)
    with pytest.raises(GainFileError, match="directory"):
        load_matrix(str(tmp_path), 4, 7)
    with pytest.raises(GainFileError, match=r"null byte.*expected 4 rows of 7"):
        load_matrix("K\0.txt", 4, 7)
    with pytest.raises(GainFileError, match=r"File name too long") as caught:
        load_matrix("K" * 200_000, 4, 7)
    assert len(str(caught.value)) < 300


@given(arrays(float, (2, 3), elements=st.floats(-1e6, 1e6)))
def test_what_is_saved_is_read_back(tmp_path_factory, matrix):
    path = str(tmp_path_factory.mktemp("gains") / "K.txt")
    save_matrix(path, matrix, "first\n\nlast")
    np.testing.assert_allclose(load_matrix(path, 2, 3), matrix, rtol=1e-11)
    with open(path) as file:
        lines = file.read().splitlines()
    # A reader that knows no comments gets all numbers before the first.
    assert [line.startswith("#") for line in lines] == [False, False, True, True, True]
    assert lines[2:] == ["# first", "#", "# last"]


# As parameters.


def test_a_zero_is_written_without_a_sign(tmp_path):
    path = tmp_path / "K.txt"
    save_matrix(str(path), [[-0.0, 1.0], [0.5, 0.0]], "gains\n\nof a test")
    assert path.read_text() == "0 1\n0.5 0\n# gains\n#\n# of a test\n"
