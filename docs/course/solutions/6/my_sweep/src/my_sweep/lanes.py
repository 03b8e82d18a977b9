"""Step 3: the path over an area, and a point that moves along it."""

import math
from dataclasses import dataclass

import numpy as np

from my_sweep.oscillator import BEGIN, END


@dataclass(frozen=True)
class Area:
    """A rectangle, m."""

    x_min: float
    x_max: float
    y_min: float
    y_max: float

    def service_position(self, x: float) -> float:
        """Return where x (m) is on the oscillator's scale: x_min is 2, x_max is 9."""
        share = (x - self.x_min) / (self.x_max - self.x_min)
        return BEGIN + (END - BEGIN) * min(max(share, 0.0), 1.0)


def corners(area: Area, width: float) -> list[tuple[float, float]]:
    """Return the ends (x, y) of the lanes, m, in the order in which they are flown.

    Lanes lead along x, there and back; they are equally wide, at most ``width`` (m).
    """
    count = math.ceil((area.y_max - area.y_min) / width - 1e-9)
    lane = (area.y_max - area.y_min) / count
    path = []
    for k in range(count):
        y = area.y_min + (k + 0.5) * lane
        ends = [(area.x_min, y), (area.x_max, y)]
        path += ends if k % 2 == 0 else ends[::-1]
    return path


class Walker:
    """A point that moves along corners.

    Attributes
    ----------
    position : ndarray, shape (2,)
        m.
    is_done : bool
        Whether it is at the last corner.
    """

    def __init__(self, start: tuple[float, float], path: list[tuple[float, float]]):
        self.position = np.array(start, dtype=float)
        self._path = [np.array(corner) for corner in path]

    @property
    def is_done(self) -> bool:
        """Whether it is at the last corner."""
        return not self._path

    def advance(self, distance: float) -> None:
        """Move on by a distance (m), around corners, too."""
        while self._path:
            way = self._path[0] - self.position
            length = float(np.hypot(*way))
            if length > distance:
                self.position += way * (distance / length)
                return
            self.position = self._path.pop(0)
            distance -= length
