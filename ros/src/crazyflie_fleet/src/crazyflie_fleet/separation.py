"""Collision avoidance: which vehicles must be held so that none comes too near to another."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crazyflie_fleet.fleet_config import DOWNWASH, close_pairs

#: Time over which motions are extrapolated (s): that in which a controller stops a vehicle.
LOOK_AHEAD = 0.5
#: Distance at which held vehicles are released, over the sum of their buffers.
RELEASE_RATIO = 1.1
#: Factors of positions before distances are calculated.
SCALE = np.array([1.0, 1.0, 1.0 / DOWNWASH])


class ClosePair(NamedTuple):
    """Two vehicles, by number, that are, or soon will be, closer than their buffers."""

    first: int
    second: int
    distance: float  # Present distance, with heights as in `close_pairs` (m).
    limit: float  # Sum of their buffers (m).


class Separation:
    """Decides which vehicles must not follow their references.

    A vehicle is held while it is too close to another, now or `LOOK_AHEAD` from now at the present
    velocities, and its reference approaches the other. One whose reference moves away is not held.
    ``buffers`` are the collision buffers of the vehicles, m.
    """

    def __init__(self, buffers: Sequence[float]):
        self._buffers = np.array(buffers, dtype=float)
        self._held = np.zeros(len(self._buffers), dtype=bool)

    def update(
        self,
        positions: NDArray[np.float64],
        velocities: NDArray[np.float64],
        goals: NDArray[np.float64],
    ) -> tuple[NDArray[np.bool_], list[ClosePair]]:
        """Return which vehicles are held, shape (n,), and the pairs that are too close.

        Positions and velocities of vehicles, and positions of references (``goals``), have the
        shape (n, 3), m and m/s, fixed frame. A vehicle whose position is NaN is ignored; the goal
        of one without a reference is its position.
        """
        known = np.flatnonzero(np.isfinite(positions).all(axis=1))
        buffers = self._buffers[known] * np.where(self._held[known], RELEASE_RATIO, 1.0)
        now, soon = positions[known], (positions + LOOK_AHEAD * velocities)[known]
        held = np.zeros_like(self._held)
        numbers = {(i, j) for places in (now, soon) for i, j, _, _ in close_pairs(places, buffers)}
        pairs = []
        for a, b in sorted(numbers):
            i, j = int(known[a]), int(known[b])
            between = (positions[j] - positions[i]) * SCALE
            held[i] |= bool((goals[i] - positions[i]) * SCALE @ between > 0.0)
            held[j] |= bool((goals[j] - positions[j]) * SCALE @ between < 0.0)
            limit = float(self._buffers[i] + self._buffers[j])
            pairs.append(ClosePair(i, j, float(np.linalg.norm(between)), limit))
        self._held = held
        return held, pairs
