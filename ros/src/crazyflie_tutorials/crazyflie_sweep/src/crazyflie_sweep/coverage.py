"""What part of an area has been covered."""

import math

import numpy as np
from numpy.typing import NDArray

from crazyflie_sweep.lanes import Point
from crazyflie_sweep.sweep_parameters import Area


class Coverage:
    """Cells of an area, and which of them something that sees a disc has passed over.

    Parameters
    ----------
    area : Area
    cell : float
        Largest width of a cell, m.
    swath : float
        Diameter of the disc, m.
    """

    def __init__(self, area: Area, cell: float, swath: float):
        xs, width = _middles(area.x_min, area.x_max, cell)
        ys, height = _middles(area.y_min, area.y_max, cell)
        self.cell_size = (width, height)  #: Width of the cells along x and y, m.
        self._radius = swath / 2.0
        self._x, self._y = np.meshgrid(xs, ys, indexing="ij")
        self._is_covered = np.zeros(self._x.shape, dtype=bool)

    def add(self, position: Point) -> bool:
        """Cover the cells whose middle is in the disc around a position; return whether any is new.

        A position at a time is enough while they are much less apart than the disc is wide.
        """
        x, y, _ = position
        is_near = (self._x - x) ** 2 + (self._y - y) ** 2 <= self._radius**2
        is_new = is_near & ~self._is_covered
        self._is_covered |= is_near
        return bool(is_new.any())

    @property
    def share(self) -> float:
        """Share of the cells that are covered, 0 to 1."""
        return float(self._is_covered.mean())

    def middles(self, covered: bool) -> NDArray[np.float64]:
        """Return the middles of the cells that are (not) covered, m, shape (n, 2)."""
        chosen = self._is_covered == covered
        return np.column_stack((self._x[chosen], self._y[chosen]))


def _middles(least, most, cell):
    count = max(1, math.ceil((most - least) / cell - 1e-9))
    width = (most - least) / count
    return least + width * (np.arange(count) + 0.5), width
