"""Where a vehicle has been, and what there is to draw around a point."""

import math
from collections import deque
from collections.abc import Sequence


class FlownPath:
    """Positions of a vehicle, thinned out and bounded, for drawing.

    A position nearer than the spacing (m) to the last one kept is dropped; of more positions than
    the capacity the oldest are dropped.
    """

    def __init__(self, spacing: float, capacity: int):
        self._spacing = spacing
        self.positions: deque[tuple[float, ...]] = deque(maxlen=capacity)  #: m, oldest first.
        self._stamp: float | None = None

    def add(self, stamp: float, position: Sequence[float]) -> bool:
        """Append the vehicle's position (x, y, z, m); return whether ``positions`` has changed.

        A stamp (s) before the last one means that time has been reset: the path begins anew.
        """
        is_reset = self._stamp is not None and stamp < self._stamp
        self._stamp = stamp
        if is_reset:
            self.positions.clear()
        elif self.positions and math.dist(position, self.positions[-1]) < self._spacing:
            return False
        self.positions.append(tuple(position))
        return True


def circle(
    centre: Sequence[float], radius: float, corners: int
) -> list[tuple[float, float, float]]:
    """Return a closed horizontal polygon about a centre (x, y, z, m): its corners, m.

    The corners, at least 3, have the distance ``radius`` (m); the first is also the last.
    """
    x, y, z = centre
    angles = [2.0 * math.pi * (k % corners) / corners for k in range(corners + 1)]
    return [(x + radius * math.cos(a), y + radius * math.sin(a), z) for a in angles]
