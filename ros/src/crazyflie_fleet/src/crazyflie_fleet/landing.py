"""Which vehicles land next, and where, so that none comes down on another.

Vehicles land in rounds, from below. In each round those land straight down that have nothing
beneath them. When only such are left that have others beneath them on the ground, the lowest of
them first fly, at their height, to the nearest places that are free.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from crazyflie_fleet.fleet_config import DOWNWASH

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SIDE_SPEED = 0.5  #: Mean speed at which vehicles fly to free places, m/s.
MAX_DETOUR = 3.0  #: How far aside along x and y a vehicle lands that descends already, m.

#: Distance of a free place from other vehicles, in distances that they must keep: for the errors of
#: their positions.
_MARGIN = 1.05

_PITCH = 0.5  #: Between two candidates for a free place, in distances that vehicles must keep.
_MAX_CANDIDATES = 400  #: Candidates, the nearest first, that are checked for a free way.
_ROUNDING = 1e-6  #: m.


def next_round(
    places: Array, lands: Flags, is_down: Flags, limits: Array, lower: Array, upper: Array
) -> dict[int, tuple[float, float]]:
    """Return which vehicles land next, and above which points they do.

    Parameters
    ----------
    places : ndarray, shape (n, 3)
        Where vehicles are, m.
    lands, is_down : ndarray of bool, shape (n,)
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
    scene = _Scene(places, lands, is_down, np.array(limits, dtype=float), lower, upper)
    straight = np.flatnonzero(scene.is_lowest & ~scene.is_obstructed)
    if straight.size:
        return {int(i): _pair(places[i]) for i in straight}
    lowest = np.flatnonzero(scene.is_lowest)
    chosen: dict[int, tuple[float, float]] = {}
    for i in lowest[np.argsort(places[lowest, 2], kind="stable")].tolist():
        free = scene.free_places(i, chosen)
        reachable = free[:_MAX_CANDIDATES][scene.are_reachable(i, free[:_MAX_CANDIDATES], chosen)]
        if len(reachable):
            chosen[i] = _pair(reachable[0])
    if not chosen and lowest.size:
        i = int(lowest[places[lowest, 2].argmin()])
        chosen[i] = _pair([*scene.free_places(i, {}), places[i]][0])
    return chosen


def free_place(i: int, places: Array, is_down: Flags, limits: Array) -> tuple[float, float]:
    """Return where a vehicle lands that descends already.

    Parameters
    ----------
    i : int
        Its number.
    places, is_down, limits
        As of `next_round`; vehicles that descend count as on the ground, at their landing places.

    Returns
    -------
    x, y : float
        m. Where it is, if nothing is beneath, or no free place within `MAX_DETOUR` can be reached
        straight.
    """
    lands = np.arange(len(places)) == i
    everywhere = np.full((len(places), 2), np.inf)
    scene = _Scene(places, lands, is_down & ~lands, limits, -everywhere, everywhere)
    if not scene.is_obstructed[i]:
        return _pair(places[i])
    free = scene.free_places(i, {}, MAX_DETOUR)[:_MAX_CANDIDATES]
    return _pair([*free[scene.are_reachable(i, free, {})], places[i]][0])


class _Scene:
    """The vehicles at one moment; see `next_round`."""

    def __init__(
        self,
        places: Array,
        lands: Flags,
        is_down: Flags,
        limits: Array,
        lower: Array,
        upper: Array,
    ) -> None:
        self._xy, self._z = places[:, :2], places[:, 2]
        self._is_down = is_down
        self._limits = limits
        self._box = lower, upper
        order = np.lexsort((np.arange(len(places)), self._z)).argsort()
        is_below = order[None, :] < order[:, None]
        is_near = cdist(self._xy, self._xy) < limits - _ROUNDING
        beneath = is_near & is_below
        # A vehicle on a table above is as much in the way of a landing.
        self.is_obstructed = (is_near & is_down | beneath & ~lands & ~is_down).any(axis=1)
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
        # Vehicles that fly above the start of the landing may be nearer.
        above = np.where(self._is_down, 0.0, np.maximum(self._z - self._z[i], 0.0)) / DOWNWASH
        needed = np.sqrt(np.maximum((_MARGIN * self._limits[i]) ** 2 - above**2, 0.0))
        needed[i] = 0.0
        is_free = (cdist(grid, self._xy) >= needed).all(axis=1)
        if chosen:
            limits = _MARGIN * self._limits[i, [*chosen]]
            is_free &= (cdist(grid, np.array([*chosen.values()])) >= limits).all(axis=1)
        return grid[is_free]

    def are_reachable(self, i, goals, chosen):
        """Return to which goals, shape (m, 2), vehicle i can fly straight, shape (m,)."""
        others = np.arange(len(self._z)) != i
        ends = self._xy.copy()
        for j, place in chosen.items():
            ends[j] = place
        # Relative to vehicle i; others move at the same time, or hover.
        begin = self._xy[others] - self._xy[i]
        way = (ends[others] - goals[:, None]) - begin
        lengths = np.maximum((way**2).sum(axis=-1), 1e-12)
        s = np.clip(-(way * begin).sum(axis=-1) / lengths, 0.0, 1.0)
        height = ((self._z[others] - self._z[i]) / DOWNWASH) ** 2
        nearest = np.sqrt(((begin + s[..., None] * way) ** 2).sum(axis=-1) + height)
        # A pair that is too near already may part.
        present = np.sqrt((begin**2).sum(axis=-1) + height)
        allowed = np.minimum(self._limits[i][others], present)
        return (nearest >= allowed - _ROUNDING).all(axis=1)


def _pair(place):
    return float(place[0]), float(place[1])
