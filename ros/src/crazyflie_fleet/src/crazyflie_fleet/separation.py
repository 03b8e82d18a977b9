"""Which vehicles have to wait so that none meets another."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crazyflie_fleet.fleet import DOWNWASH, close_pairs

LOOK_AHEAD = 0.5
"""How far ahead of now the vehicles' motion is regarded, s: what a controller needs to stop one."""

RELEASE = 1.1
"""A pair has to be this much farther apart than it must before neither waits any more."""


@dataclass(frozen=True)
class Closeness:
    """Two vehicles that are, or soon will be, closer than their buffers.

    Attributes
    ----------
    first, second : int
        Their numbers.
    distance : float
        Now, m; heights count as in `close_pairs`.
    limit : float
        Sum of their buffers, m.
    """

    first: int
    second: int
    distance: float
    limit: float


class Separation:
    """Decide which vehicles must not follow their references.

    A vehicle waits while it is too close to another, now or `LOOK_AHEAD` from now if both go on
    as they do, and its reference leads it nearer. One whose reference leads it away does not wait,
    so that a pair that has met can part.

    Parameters
    ----------
    buffers : sequence of float
        Radius of each vehicle's own space, m.
    """

    def __init__(self, buffers: Sequence[float]):
        self._buffers = np.array(buffers, dtype=float)
        self._scale = np.array([1.0, 1.0, 1.0 / DOWNWASH])
        self._waiting = np.zeros(len(self._buffers), dtype=bool)

    def waiting(
        self,
        positions: NDArray[np.float64],
        velocities: NDArray[np.float64],
        goals: NDArray[np.float64],
    ) -> tuple[NDArray[np.bool_], list[Closeness]]:
        """Return who has to wait, and because of what.

        Parameters
        ----------
        positions, velocities, goals : (n, 3) array
            Where each is, how it moves, and where its reference is: m, m/s, fixed frame. A vehicle
            without a position is NaN and is not regarded; one without a goal has its position.

        Returns
        -------
        (n,) array of bool
        list of Closeness
            Pairs that are too close now or soon.
        """
        known = np.flatnonzero(np.isfinite(positions).all(axis=1))
        buffers = self._buffers[known] * np.where(self._waiting[known], RELEASE, 1.0)
        now, soon = positions[known], (positions + LOOK_AHEAD * velocities)[known]
        waiting = np.zeros_like(self._waiting)
        pairs = {(i, j) for places in (now, soon) for i, j, _, _ in close_pairs(places, buffers)}
        found = []
        for a, b in sorted(pairs):
            i, j = int(known[a]), int(known[b])
            between = (positions[j] - positions[i]) * self._scale
            waiting[i] |= bool((goals[i] - positions[i]) * self._scale @ between > 0.0)
            waiting[j] |= bool((goals[j] - positions[j]) * self._scale @ between < 0.0)
            limit = float(self._buffers[i] + self._buffers[j])
            found.append(Closeness(i, j, float(np.linalg.norm(between)), limit))
        self._waiting = waiting
        return waiting, found
