"""Where a vehicle has been, and what there is to draw around a point."""

import math
from collections import deque
from collections.abc import Sequence
from typing import Protocol, Self


class Stamp(Protocol):
    """A time that can be compared, such as rospy.Time or a number."""

    def __lt__(self, other: Self, /) -> bool:
        """Tell whether this is before another."""


class FlownPath:
    """Positions of a vehicle, thinned out and bounded, for drawing.

    Parameters
    ----------
    spacing : float
        A position nearer than this (m) to the last one kept is dropped.
    capacity : int
        How many positions are kept; the oldest go first.
    """

    def __init__(self, spacing: float, capacity: int):
        self._spacing = spacing
        self._positions: deque[tuple[float, ...]] = deque(maxlen=capacity)
        self._stamp: Stamp | None = None

    @property
    def positions(self) -> list[tuple[float, ...]]:
        """Positions (x, y, z) in m, oldest first."""
        return list(self._positions)

    def add(self, stamp: Stamp, position: Sequence[float]) -> bool:
        """Take note of where the vehicle was.

        Parameters
        ----------
        stamp : Stamp
            When. A stamp before the last one means that time has been reset: the path begins anew.
        position : sequence of float, length 3
            Where, m, fixed frame.

        Returns
        -------
        bool
            Whether ``positions`` has changed.
        """
        is_reset = self._stamp is not None and stamp < self._stamp
        self._stamp = stamp
        if is_reset:
            self._positions.clear()
        elif self._positions and math.dist(position, self._positions[-1]) < self._spacing:
            return False
        self._positions.append(tuple(position))
        return True


def circle(
    centre: Sequence[float], radius: float, corners: int
) -> list[tuple[float, float, float]]:
    """Return a closed horizontal polygon: its corners (x, y, z), the first again as the last.

    Parameters
    ----------
    centre : sequence of float, length 3
        m.
    radius : float
        From the centre to the corners, m.
    corners : int
        At least 3.
    """
    x, y, z = centre
    angles = [2.0 * math.pi * (k % corners) / corners for k in range(corners + 1)]
    return [(x + radius * math.cos(a), y + radius * math.sin(a), z) for a in angles]
