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

from crazyflie_utils.parameters.types import TEXT, ParameterType
from crazyflie_utils.text import number_from_text, shortened, shown


class GainFileError(ValueError):
    """A gain file is invalid; the text names the file, the line and the expected shape."""


def load_matrix(path: str, rows: int, columns: int) -> NDArray[np.float64]:
    """Return the matrix of finite numbers in a file, shape (rows, columns), or `GainFileError`."""
    expected = f"expected {rows} rows of {columns} numbers"
    matrix: list[list[float]] = []
    for number, row in _rows(path, expected):
        if len(row) != columns:
            raise GainFileError(f"{path}, line {number}: {_count(row)}, {expected}")
        if len(matrix) == rows:
            raise GainFileError(f"{path}, line {number}: row {rows + 1}, {expected}")
        matrix.append(row)
    if len(matrix) != rows:
        last = number if matrix else 0
        raise GainFileError(f"{path}: ends after {len(matrix)} rows (line {last}), {expected}")
    return np.array(matrix)


def load_vector(path: str, length: int) -> NDArray[np.float64]:
    """Return the vector in a file, shape (length,): one row or one column; see `load_matrix`."""
    expected = f"expected {length} numbers in one row or one column"
    vector: list[float] = []
    width = 0
    for number, row in _rows(path, expected):
        width = width or len(row)
        vector += row
        if len(row) != width or width not in (1, length) or len(vector) > length:
            raise GainFileError(f"{path}, line {number}: {_count(row)}, {expected}")
    if len(vector) != length:
        last = number if vector else 0
        raise GainFileError(f"{path}: ends after {_count(vector)} (line {last}), {expected}")
    return np.array(vector)


def save_matrix(path: str, matrix: ArrayLike, comment: str = "") -> None:
    """Write a matrix, shape (rows, columns), with 12 digits, and a comment at the end."""
    with open(path, "w", encoding="utf-8") as file:
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


@dataclass(frozen=True)
class VectorFile(ParameterType):
    """The path of a gain file; the value is its vector, of this length."""

    length: int
    label = "path"

    @override
    def __call__(self, value: Any) -> NDArray[np.float64]:
        return load_vector(TEXT(value), self.length)

    def __str__(self) -> str:
        return f"the path of a text file with {self.length} numbers in one row or one column"


def _rows(path, expected):
    """Yield line number and numbers of every line that has any."""
    try:
        with open(path, encoding="utf-8", errors="replace") as file:
            lines = file.read().split("\n")
    except (OSError, ValueError) as error:
        # A path with a NUL character raises ValueError.
        reason = error.strerror if isinstance(error, OSError) else error
        where = shortened(os.path.abspath(path))
        raise GainFileError(f"cannot read {where}: {reason}, {expected}") from None
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


def _count(row):
    return "1 number" if len(row) == 1 else f"{len(row)} numbers"
