"""Trajectories made of polynomials of the 7th degree in x, y, z and yaw."""

import csv
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

COEFFICIENTS = 8
"""Of a polynomial, the constant first."""

COLUMNS = 1 + 4 * COEFFICIENTS
"""Of a line in a file: duration, then the coefficients of x, y, z and yaw."""

_GAP = 0.01
"""How far apart two pieces may be where they meet, m or rad."""


class TrajectoryError(Exception):
    """A file holds no trajectory that can be flown; the text says where and why."""


class Piece(NamedTuple):
    """One piece.

    Attributes
    ----------
    duration : float
        s, > 0.
    coefficients : ndarray, shape (4, 8)
        Of x, y, z (m) and yaw (rad) as polynomials of the time since the piece began (s), the
        constant first.
    """

    duration: float
    coefficients: np.ndarray

    def evaluate(self, time, order: int = 0) -> np.ndarray:
        """Return x, y, z, yaw, or a derivative of them.

        Parameters
        ----------
        time : float or ndarray
            s since the piece began.
        order : int
            Of the derivative by time.

        Returns
        -------
        ndarray, shape (4, *time.shape)
        """
        polynomials = self.coefficients.T
        if order:
            polynomials = np.polynomial.polynomial.polyder(polynomials, order)
        return np.polynomial.polynomial.polyval(time, polynomials)


def load(path) -> list[Piece]:
    """Return the pieces of a trajectory in a CSV file.

    Each line is a piece, with `COLUMNS` numbers; a first line without numbers is a
    heading, and empty lines do not count.

    Parameters
    ----------
    path : str or Path

    Raises
    ------
    TrajectoryError
        The file cannot be read; a line is malformed; or two pieces do not meet.
    """
    try:
        text = Path(path).read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise TrajectoryError(f"cannot read {path}: {error}") from None
    pieces = []
    for number, line in enumerate(csv.reader(text.splitlines()), start=1):
        cells = [cell.strip() for cell in line]
        is_heading = number == 1 and cells and not _is_number(cells[0])
        if any(cells) and not is_heading:
            pieces.append(_piece(cells, f"{path}, line {number}"))
    if not pieces:
        raise TrajectoryError(f"{path} holds no pieces")
    for number, (one, two) in enumerate(zip(pieces, pieces[1:], strict=False)):
        gap = np.abs(two.evaluate(0.0) - one.evaluate(one.duration)).max()
        if gap > _GAP:
            raise TrajectoryError(
                f"{path}: piece {number + 1} begins {gap:.3g} (m or rad) from where piece "
                f"{number} ends; expected at most {_GAP:g}"
            )
    return pieces


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
            raise TrajectoryError(f"{where}: {cell!r} is no finite number")
    duration, *coefficients = map(float, cells)
    if duration <= 0.0:
        raise TrajectoryError(f"{where}: the duration is {duration:g}; expected more than 0 s")
    return Piece(duration, np.reshape(coefficients, (4, COEFFICIENTS)))


def _is_number(cell):
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


def save(path, pieces: list[Piece]) -> None:
    """Write pieces to a file that `load` reads."""
    names = [f"{axis}^{power}" for axis in ("x", "y", "z", "yaw") for power in range(COEFFICIENTS)]
    lines = [",".join(["duration", *names])]
    for piece in pieces:
        numbers = [piece.duration, *piece.coefficients.ravel()]
        lines.append(",".join(f"{number:.9g}" for number in numbers))
    Path(path).write_text("\n".join(lines) + "\n")


class Summary(NamedTuple):
    """Duration (s), largest speed (m/s) and largest acceleration (m/s^2) of a trajectory."""

    duration: float
    speed: float
    acceleration: float


def summary(pieces: list[Piece]) -> Summary:
    """Return what a trajectory asks of a vehicle, from 100 points a piece."""
    largest = [0.0, 0.0]
    for piece in pieces:
        times = np.linspace(0.0, piece.duration, 100)
        for order in (1, 2):
            norms = np.linalg.norm(piece.evaluate(times, order)[:3], axis=0)
            largest[order - 1] = max(largest[order - 1], float(norms.max()))
    return Summary(sum(piece.duration for piece in pieces), *largest)


def hermite(start: np.ndarray, end: np.ndarray, duration: float) -> np.ndarray:
    """Return the polynomial of the 7th degree with given derivatives at both ends.

    Parameters
    ----------
    start, end : ndarray, shape (4,)
        Value and first three derivatives by time.
    duration : float
        Time between them, s.

    Returns
    -------
    ndarray, shape (8,)
        Coefficients, the constant first.
    """
    rows = []
    for time in (0.0, duration):
        for order in range(4):
            row = np.zeros(COEFFICIENTS)
            for power in range(order, COEFFICIENTS):
                row[power] = math.perm(power, order) * time ** (power - order)
            rows.append(row)
    return np.linalg.solve(np.array(rows), np.concatenate([start, end]))
