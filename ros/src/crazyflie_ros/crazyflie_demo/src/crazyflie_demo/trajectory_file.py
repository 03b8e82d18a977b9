"""Files of polynomial trajectories, and their speed and acceleration."""

import csv
import io
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from crazyflie_model.elementwise import join
from crazyflie_model.polynomials import COEFFICIENTS, PolynomialPiece
from crazyflie_utils.text import number_from_text, shortened, shown
from crazyflie_utils.text_file import TextFileError, read_text, user_path

#: Numbers in a line of a file: duration, then the coefficients of x, y, z and yaw.
COLUMNS = 1 + 4 * COEFFICIENTS
_GAP = 0.01  #: Largest gap between two pieces where they meet (m or rad).


class TrajectoryError(ValueError):
    """A file has no trajectory that can be flown; the text says where and why."""


def load(path: str | Path) -> list[PolynomialPiece]:
    """Return the pieces of a trajectory in a CSV file.

    Each line is a piece, with `COLUMNS` numbers; a first line without any number is a heading, and
    empty lines are ignored. Raises `TrajectoryError` for a file that cannot be read, a malformed
    line, or two pieces that do not meet.
    """
    pieces = []
    for index, (line, cells) in enumerate(_rows(path)):
        is_heading = index == 0 and not any(map(_is_number, cells))
        if any(cells) and not is_heading:
            pieces.append(_piece(cells, f"{path}, line {line}"))
    if not pieces:
        raise TrajectoryError(f"{path} has no pieces")
    for number, (one, two) in enumerate(zip(pieces, pieces[1:], strict=False)):
        end, start = one.evaluate(one.duration), two.evaluate(0.0)
        gap = np.abs(np.subtract((*start.position, start.yaw), (*end.position, end.yaw))).max()
        if gap > _GAP:
            raise TrajectoryError(
                f"{path}: piece {number + 1} begins {gap:.3g} (m or rad) from where piece "
                f"{number} ends; expected at most {_GAP:g}"
            )
    return pieces


def _rows(path):
    """Yield number and cells of every line; with line breaks in a cell, the last number."""
    try:
        text = read_text(path)
    except TextFileError as error:
        where = shortened(str(path)) if error.line is None else f"{path}, line {error.line}"
        raise TrajectoryError(f"{where}: {error}") from None
    reader = csv.reader(io.StringIO(text, newline=""))
    try:
        for row in reader:
            yield reader.line_num, [cell.strip() for cell in row]
    except csv.Error as error:
        raise TrajectoryError(f"{path}, line {reader.line_num}: {error}") from None


def _piece(cells, where):
    if cells[-1] == "" and len(cells) == COLUMNS + 1:
        # Some programs end a line with a comma.
        cells = cells[:-1]
    if len(cells) != COLUMNS:
        raise TrajectoryError(
            f"{where} has {len(cells)} columns; expected {COLUMNS}: the duration and "
            f"{COEFFICIENTS} coefficients each of x, y, z and yaw"
        )
    for cell in cells:
        if not _is_number(cell):
            raise TrajectoryError(f"{where}: {shown(cell)} is not a finite number")
    duration, *coefficients = map(number_from_text, cells)
    if duration <= 0.0:
        raise TrajectoryError(f"{where}: the duration is {duration:g}; expected more than 0 s")
    return PolynomialPiece(duration, *np.reshape(coefficients, (4, COEFFICIENTS)).tolist())


def _is_number(cell):
    try:
        return math.isfinite(number_from_text(cell))
    except ValueError:
        return False


def save(path: str | Path, pieces: list[PolynomialPiece]) -> None:
    """Write pieces to a file that `load` reads."""
    names = [f"{axis}^{power}" for axis in ("x", "y", "z", "yaw") for power in range(COEFFICIENTS)]
    lines = [",".join(["duration", *names])]
    for piece in pieces:
        numbers = [piece.duration, *(c for axis in piece.padded_axes for c in axis)]
        lines.append(",".join(f"{number:.9g}" for number in numbers))
    user_path(path).write_text("\n".join(lines) + "\n")


class Summary(NamedTuple):
    """Duration (s), largest speed (m/s) and largest acceleration (m/s^2) of a trajectory."""

    duration: float
    speed: float
    acceleration: float


def summary(pieces: list[PolynomialPiece]) -> Summary:
    """Return duration and largest values of a trajectory, from 100 points a piece."""
    largest = [0.0, 0.0]
    for piece in pieces:
        times = np.linspace(0.0, piece.duration, 100, dtype=np.float64)
        goal = piece.evaluate(times)
        for i, vectors in enumerate((goal.velocity, goal.acceleration)):
            largest[i] = max(largest[i], float(np.linalg.norm(join(vectors), axis=-1).max()))
    return Summary(sum(piece.duration for piece in pieces), *largest)
