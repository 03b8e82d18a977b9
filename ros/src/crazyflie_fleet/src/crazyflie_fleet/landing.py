"""Which vehicles land next, and where, so that none comes down on another.

Vehicles land in rounds, from below. In each round those land straight down that have nothing
beneath them. When only such are left that have others beneath them on the ground, the lowest of
them first fly, at their height, to the nearest places that are free.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from crazyflie_fleet.fleet import DOWNWASH

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SIDE_SPEED = 0.5
"""Mean speed at which vehicles fly to free places, m/s."""

MAX_DETOUR = 3.0
"""How far aside along x and y a vehicle lands that descends already, m."""

_MARGIN = 1.05
"""How much farther than it must be a free place is from others: vehicles are not exactly where they
were told to be."""

_PITCH = 0.5
"""From one candidate for a free place to the next, in distances that vehicles keep."""

_MOST_WAYS = 400
"""Candidates, the nearest first, to which the way is looked at."""

_ROUNDING = 1e-6
"""m."""


def next_round(
    places: Array, lands: Flags, stands: Flags, limits: Array, lower: Array, upper: Array
) -> dict[int, tuple[float, float]]:
    """Return which vehicles land next, and above which points they do.

    Parameters
    ----------
    places : ndarray, shape (n, 3)
        Where vehicles are, m.
    lands, stands : ndarray of bool, shape (n,)
        Which of them are in flight and to land, and which are on the ground. The others are in
        flight and stay where they are.
    limits : ndarray, shape (n, n)
        How far apart each two have to be, m; heights count for 1 / `DOWNWASH`.
    lower, upper : ndarray, shape (n, 2)
        Corners x, y of the box that each may land in, m.

    Returns
    -------
    dict of int to tuple
        Number to x, y in m: where the vehicle is, or a free place, to which all of the round can
        fly straight and at the same time. At least one vehicle, if any is to land. Where no way is
        free, one vehicle has a place that is; where there is none, its own.
    """
    picture = _Picture(places, lands, stands, np.array(limits, dtype=float), lower, upper)
    straight = np.flatnonzero(picture.is_lowest & ~picture.is_obstructed)
    if straight.size:
        return {int(i): _pair(places[i]) for i in straight}
    lowest = np.flatnonzero(picture.is_lowest)
    chosen: dict[int, tuple[float, float]] = {}
    for i in lowest[np.argsort(places[lowest, 2], kind="stable")].tolist():
        free = picture.free_places(i, chosen)
        reachable = free[:_MOST_WAYS][picture.are_clear(i, free[:_MOST_WAYS], chosen)]
        if len(reachable):
            chosen[i] = _pair(reachable[0])
    if not chosen and lowest.size:
        i = int(lowest[places[lowest, 2].argmin()])
        chosen[i] = _pair([*picture.free_places(i, {}), places[i]][0])
    return chosen


def free_place(i: int, places: Array, stands: Flags, limits: Array) -> tuple[float, float]:
    """Return where a vehicle lands that descends already.

    Parameters
    ----------
    i : int
        Its number.
    places, stands, limits
        As of `next_round`; vehicles that descend count as on the ground, at their landing places.

    Returns
    -------
    x, y : float
        m. Where it is, if nothing is beneath, or no free place within `MAX_DETOUR` can be reached
        straight.
    """
    lands = np.arange(len(places)) == i
    everywhere = np.full((len(places), 2), np.inf)
    picture = _Picture(places, lands, stands & ~lands, limits, -everywhere, everywhere)
    if not picture.is_obstructed[i]:
        return _pair(places[i])
    free = picture.free_places(i, {}, MAX_DETOUR)[:_MOST_WAYS]
    return _pair([*free[picture.are_clear(i, free, {})], places[i]][0])


class _Picture:
    """The vehicles at one moment; see `next_round`."""

    def __init__(
        self,
        places: Array,
        lands: Flags,
        stands: Flags,
        limits: Array,
        lower: Array,
        upper: Array,
    ) -> None:
        self._xy, self._z = places[:, :2], places[:, 2]
        self._stands = stands
        self._limits = limits
        self._box = lower, upper
        order = np.lexsort((np.arange(len(places)), self._z)).argsort()
        is_below = order[None, :] < order[:, None]
        is_near = cdist(self._xy, self._xy) < limits - _ROUNDING
        np.fill_diagonal(is_near, val=False)
        beneath = is_near & is_below
        # What stands higher, on a table, is as much in the way of a landing.
        self.is_obstructed = (is_near & stands | beneath & ~lands & ~stands).any(axis=1)
        self.is_lowest = lands & ~(beneath & lands).any(axis=1)

    def free_places(self, i, chosen, reach=math.inf):
        """Return places to land for vehicle i, the nearest first, shape (m, 2)."""
        step = _PITCH * self._limits[i].max()
        count = math.ceil(min(2.0 * (math.sqrt(len(self._z)) + 1.0) / _PITCH, reach / step))
        axis = step * np.arange(-count, count + 1)
        grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
        grid = self._xy[i] + grid[np.hypot(*grid.T).argsort(kind="stable")]
        lower, upper = self._box[0][i], self._box[1][i]
        grid = grid[((grid >= lower) & (grid <= upper)).all(axis=1)]
        # Who flies higher than the landing begins may be nearer.
        above = np.where(self._stands, 0.0, np.maximum(self._z - self._z[i], 0.0)) / DOWNWASH
        needed = np.sqrt(np.maximum((_MARGIN * self._limits[i]) ** 2 - above**2, 0.0))
        needed[i] = 0.0
        is_free = (cdist(grid, self._xy) >= needed).all(axis=1)
        if chosen:
            limits = _MARGIN * self._limits[i, [*chosen]]
            is_free &= (cdist(grid, np.array([*chosen.values()])) >= limits).all(axis=1)
        return grid[is_free]

    def are_clear(self, i, goals, chosen):
        """Return to which goals, shape (m, 2), vehicle i can fly straight, shape (m,)."""
        others = np.arange(len(self._z)) != i
        ends = self._xy.copy()
        for j, place in chosen.items():
            ends[j] = place
        # As each sees the others, who fly at the same time or not at all.
        begin = self._xy[others] - self._xy[i]
        way = (ends[others] - goals[:, None]) - begin
        lengths = np.maximum((way**2).sum(axis=-1), 1e-12)
        s = np.clip(-(way * begin).sum(axis=-1) / lengths, 0.0, 1.0)
        height = ((self._z[others] - self._z[i]) / DOWNWASH) ** 2
        nearest = np.sqrt(((begin + s[..., None] * way) ** 2).sum(axis=-1) + height)
        # Those that are too near already may part.
        present = np.sqrt((begin**2).sum(axis=-1) + height)
        allowed = np.minimum(self._limits[i][others], present)
        return (nearest >= allowed - _ROUNDING).all(axis=1)


def _pair(place):
    return float(place[0]), float(place[1])
