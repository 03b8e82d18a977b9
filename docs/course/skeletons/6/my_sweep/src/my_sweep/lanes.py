"""Step 3: the path over an area, and a point that moves along it."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Area:
    """A rectangle, m."""

    x_min: float
    x_max: float
    y_min: float
    y_max: float

    def service_position(self, x: float) -> float:
        """Return where x (m) is on the oscillator's scale: x_min is 2, x_max is 9."""
        raise NotImplementedError("step 3")


def corners(area: Area, width: float) -> list[tuple[float, float]]:
    """Return the ends (x, y) of the lanes, m, in the order in which they are flown.

    Lanes lead along x, there and back; they are equally wide, at most ``width`` (m).
    """
    raise NotImplementedError("step 3")


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
        raise NotImplementedError("step 3")
