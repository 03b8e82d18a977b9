"""Gain files: matrices as text.

One row of the matrix a line, numbers separated by blanks; empty lines, and text that
follows a ``#``, are skipped. Written files have their comments at the end:
the reader of the C++ workspace knows no comments, and stops at the first.
"""

import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import override

from crazyflie_utils import text_file
from crazyflie_utils.parameters.types import TEXT, Converted, ParameterType
from crazyflie_utils.text import number_from_text, shortened, shown
from crazyflie_utils.text_file import user_path


class GainFileError(ValueError):
    """A gain file is invalid; the text names the file, the line and the expected shape."""


def load_matrix(path: str, rows: int, columns: int) -> NDArray[np.float64]:
    """Return the matrix of finite numbers in a file, shape (rows, columns), or `GainFileError`."""
    return _load(path, [(rows, columns)], f"expected {rows} rows of {columns} numbers", "row")


def load_vector(path: str, length: int) -> NDArray[np.float64]:
    """Return the vector in a file, shape (length,): one row or one column; see `load_matrix`."""
    expected = f"expected {length} numbers in one row or one column"
    return _load(path, [(1, length), (length, 1)], expected, "number").ravel()


def _load(path, shapes, expected, unit):
    most = max(rows for rows, _ in shapes)
    matrix: list[list[float]] = []
    for number, row in _rows(path, expected):
        shapes = [shape for shape in shapes if shape[0] > len(matrix) and shape[1] == len(row)]
        matrix.append(row)
        if not shapes:
            what = _count(len(row), "number")
            if len(matrix) > most:
                what = f"row {len(matrix)} of {what}"
            raise GainFileError(f"{path}, line {number}: {what}, {expected}")
    if all(rows > len(matrix) for rows, _ in shapes):
        last = number if matrix else 0
        what = _count(len(matrix), unit)
        raise GainFileError(f"{path}: ends after {what} (line {last}), {expected}")
    return np.array(matrix)


def save_matrix(path: str, matrix: ArrayLike, comment: str = "") -> None:
    """Write a matrix, shape (rows, columns), with 12 digits, and a comment at the end."""
    with open(user_path(path), "w", encoding="utf-8") as file:
        # Adding 0 turns -0, whose sign would look meaningful, into 0.
        for row in np.asarray(matrix) + 0.0:
            file.write(" ".join(f"{value:.12g}" for value in row) + "\n")
        for line in comment.splitlines():
            file.write(f"# {line}".rstrip() + "\n")


@dataclass(frozen=True)
class MatrixFile(ParameterType):
    """The path of a gain file; the value is its matrix, of this shape."""

    rows: int
    columns: int
    label = "path"

    @override
    def __call__(self, value: Any) -> NDArray[np.float64]:
        return load_matrix(TEXT(value), self.rows, self.columns)

    def __str__(self) -> str:
        return f"the path of a text file with {self.rows} rows of {self.columns} numbers"


#: The path of a gain file; the value is its vector, a control.
CONTROL_FILE = Converted(
    lambda path: load_vector(TEXT(path), 4),
    "the path of a text file with 4 numbers in one row or one column",
    "path",
)


def _rows(path, expected):
    """Yield line number and numbers of every line that has any."""
    try:
        content = text_file.content(path, text_file.MAX_SIZE)
    except (OSError, ValueError) as error:
        # A path with a NUL character raises ValueError.
        reason = error.strerror if isinstance(error, OSError) else error
        where = shortened(os.path.abspath(user_path(path)))
        raise GainFileError(f"cannot read {where}: {reason}, {expected}") from None
    lines = content.decode(errors="replace").replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if lines[-1].endswith(".") and "#" not in lines[-1]:
        # With a line break behind it, the number would be valid.
        raise GainFileError(
            f"{path}, line {len(lines)}: the file ends in a number without the digits behind its "
            f"point; expected them, or a line break, {expected}"
        )
    for number, line in enumerate(lines, start=1):
        tokens = line.partition("#")[0].split()
        if tokens:
            yield number, [_number(token, f"{path}, line {number}", expected) for token in tokens]


def _number(token, where, expected):
    try:
        value = number_from_text(token)
    except ValueError:
        raise GainFileError(f"{where}: {shown(token)} is not a number, {expected}") from None
    if not math.isfinite(value):
        raise GainFileError(f"{where}: {shown(token)} is not finite, {expected}")
    return value


def _count(count, unit):
    return f"{count} {unit}" if count == 1 else f"{count} {unit}s"
