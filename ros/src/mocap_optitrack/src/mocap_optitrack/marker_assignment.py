"""Which point of a frame is which marker."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from mocap_optitrack.marker_motion import UNSEEN_COST, MarkerMotion, Point

#: By how much the second-best assignment has to cost more: it is less likely by exp(-3), which is 1
#: in 20.
_AMBIGUITY = 6.0

_IMPOSSIBLE = 1e6


def assign(
    motions: Sequence[MarkerMotion], time: float, points: Point
) -> tuple[dict[int, int], set[int]]:
    """Return index of marker -> index of point, and the markers that may be another point, too.

    The assignment is the most likely one: it has the least sum of `MarkerMotion.costs`, and of
    `UNSEEN_COST` for each marker that is not seen. A pair is ambiguous when the marker has another
    point within its gate, or the point another marker, and the best assignment without the pair
    costs little more. ``time`` is the frame's, s; ``points`` are of shape (n, 3), m.
    """
    m, n = len(motions), len(points)
    costs = np.full((m, n + m), _IMPOSSIBLE)
    for row, motion in enumerate(motions):
        costs[row, :n] = np.minimum(motion.costs(time, points), _IMPOSSIBLE)
        costs[row, n + row] = UNSEEN_COST
    rows, columns = linear_sum_assignment(costs)
    best = costs[rows, columns].sum()
    pairs = {int(r): int(c) for r, c in zip(rows, columns, strict=True) if c < n}
    possible = costs[:, :n] < _IMPOSSIBLE
    rivals = possible.sum(axis=0)
    ambiguous = {
        row
        for row, column in pairs.items()
        if possible[row].sum() + rivals[column] > 2
        and _best_without(costs, row, column) - best < _AMBIGUITY
    }
    return pairs, ambiguous


def _best_without(costs, row, column):
    others = costs.copy()
    others[row, column] = _IMPOSSIBLE
    return others[linear_sum_assignment(others)].sum()
