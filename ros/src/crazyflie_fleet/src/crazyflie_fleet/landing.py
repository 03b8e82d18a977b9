"""Landings in rounds: which vehicles land next, and where, so that none comes down on another.

Vehicles land in rounds, the lowest ones first. In each round the vehicles with nothing beneath them
land straight down. When all that are left have others beneath them on the ground, the lowest ones
first fly, at their height, to the nearest free places. A vehicle that descends by itself is moved
to a place next to those beneath it.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from crazyflie_fleet.fleet_config import DOWNWASH
from crazyflie_model.planner import MAX_ACCELERATION, MAX_SPEED
from crazyflie_model.trajectory import (
    MINIMUM_JERK_ACCELERATION,
    MINIMUM_JERK_SPEED,
    minimum_jerk,
)

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Place = tuple[float, float, float]  #: x, y, z (m).

#: Names of the vehicles whose positions are known, and the arguments of `next_round` but ``lands``.
Situation = tuple[Sequence[str], Array, Flags, Array, Array, Array]

SIDE_SPEED = 0.5  #: Mean speed at which vehicles fly to free places (m/s).
MAX_DETOUR = 3.0  #: Largest move along x and y of a vehicle that descends already (m).

#: Distance of a free place from other vehicles over the distance that they must keep, to allow for
#: errors of their positions.
_MARGIN = 1.05

#: Distance from its free place within which a vehicle lands (m), and the larger one that is
#: accepted after the planned duration plus `LandingSide.arrival_timeout` (m).
_ARRIVED, _NEAR = 0.05, 0.1

_PITCH = 0.5  #: Distance of two candidates for a free place over that which vehicles must keep.
_MAX_CANDIDATES = 400  #: Number of candidates, the nearest first, that are checked for a free path.
_ROUNDING = 1e-6  #: Tolerance of comparisons of distances (m).

_SIDE_DURATION = 1.1  #: Duration of the move sideways over the shortest possible one.
_MAX_GAP = 0.5  #: Longest time between two references of one descent (s).


class LandingSide(Protocol):
    """Interface of a process of a fleet, or of a mission, that carries out landings.

    A vehicle that refuses a command is not `left` any more.
    """

    arrival_timeout: float  #: Longest time beyond the planned duration of a move (s).

    def time(self) -> float:
        """Return the time, s."""

    def left(self) -> list[str]:
        """Return the names of the vehicles in the air that have still to land."""

    def is_busy(self) -> bool:
        """Return whether vehicles descend, or are too fast for a round."""

    def situation(self) -> Situation:
        """Return the positions of all vehicles."""

    def distance(self, name: str, goal: Place) -> float:
        """Return the distance of a vehicle from a goal (m), m; infinite if it is not known."""

    def go_aside(self, goals: Mapping[str, Place]) -> float:
        """Send vehicles to free places, m; return when they should be there, s."""

    def descend(self, names: Sequence[str]) -> None:
        """Land vehicles straight down."""

    def refuse(self, name: str, reason: str) -> None:
        """Leave a vehicle in the air."""


def land_in_rounds(side: LandingSide) -> Iterator[None]:
    """Land the vehicles that are left, also those added meanwhile; yield while it must wait."""
    while True:
        while side.is_busy():
            yield
        if not (left := side.left()):
            return
        situation = side.situation()
        names, places = situation[:2]
        lands = np.array([name in left for name in names])
        goals, aside = {}, {}
        for k, (x, y) in next_round(places, lands, *situation[2:]).items():
            goal = goals[names[k]] = (x, y, float(places[k, 2]))
            if (x, y) != _pair(places[k]):
                aside[names[k]] = goal
        if aside:
            yield from _go_aside(side, aside)
        if down := [name for name in side.left() if name in goals]:
            side.descend(down)


def _go_aside(side, goals):
    """Wait until vehicles are at free places, m; those that do not get there are refused."""
    end = side.go_aside(goals)
    limit = end + side.arrival_timeout

    def away():
        return {name: side.distance(name, goals[name]) for name in side.left() if name in goals}

    while (found := away()) and (
        side.time() < end or (max(found.values()) > _ARRIVED and side.time() <= limit)
    ):
        yield
    for name, distance in found.items():
        if distance > _NEAR:
            x, y, _ = goals[name]
            far = "not known" if math.isinf(distance) else f"{distance:.2f} m"
            place = f"the free place to land at ({x:.2f}, {y:.2f})"
            side.refuse(name, f"stays in the air: its distance from {place} is {far}")


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
        Distances that each two must keep, m; heights are divided by `DOWNWASH`.
    lower, upper : ndarray, shape (n, 2)
        Corners x, y of the box that each may land in, m.

    Returns
    -------
    dict of int to tuple
        Number to x, y in m: where the vehicle is, or a free place, to which all of the round can
        fly straight and at the same time. At least one vehicle, if any is to land. If no path is
        free, one vehicle gets a free place; if no place is free, its own.
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
    """Return the landing place of a vehicle that descends already.

    Parameters
    ----------
    i : int
        Its number.
    places, is_down, limits
        As for `next_round`; descending vehicles are on the ground, at their landing places.

    Returns
    -------
    x, y : float
        m. Its own position if nothing is beneath, or if no free place within `MAX_DETOUR` can be
        reached on a straight line.
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
        # A vehicle above, on a table, obstructs a landing as well.
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
        """Return whether vehicle i can fly straight to each goal; shapes (m, 2) and (m,)."""
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
        # Vehicles that are too near already may move apart.
        present = np.sqrt((begin**2).sum(axis=-1) + height)
        allowed = np.minimum(self._limits[i][others], present)
        return (nearest >= allowed - _ROUNDING).all(axis=1)


def _pair(place):
    return float(place[0]), float(place[1])


@dataclass
class _Descent:
    """A move from a start (x, y, z) to a landing place (x, y), m; times are in s."""

    start: NDArray[np.float64]
    place: NDArray[np.float64]
    duration: float
    begin: float
    last: float


class SafeDescents:
    """Landing places of vehicles that descend.

    A vehicle with another one beneath flies to the nearest free place while it sinks. ``buffers``
    are the collision buffers of all vehicles, m.
    """

    def __init__(self, buffers: Sequence[float]):
        radii = np.array(buffers, dtype=float)
        self._limits = radii[:, None] + radii
        self._descents: dict[int, _Descent] = {}

    def is_under_way(self, number: int, time: float) -> bool:
        """Return whether a reference at a time (s) belongs to the present descent of a vehicle."""
        descent = self._descents.get(number)
        return descent is not None and 0.0 <= time - descent.last < _MAX_GAP

    def begin(
        self,
        number: int,
        time: float,
        positions: NDArray[np.float64],
        is_landing: NDArray[np.bool_],
    ) -> float:
        """Choose the landing place of a vehicle at a time (s); return its distance, m.

        Parameters
        ----------
        positions : (n, 3) array
            Positions of all vehicles, m; NaN where they are not known.
        is_landing : (n,) array of bool
            Which of them descend, or are on the ground.
        """
        start, places = positions[number].copy(), positions.copy()
        for other, descent in self._descents.items():
            if self.is_under_way(other, time):
                places[other, :2] = descent.place
        known = np.asarray(np.isfinite(places).all(axis=1))
        place = start[:2]
        if known[number]:
            index, limits = int(known[:number].sum()), self._limits[np.ix_(known, known)]
            place = np.array(free_place(index, places[known], is_landing[known], limits))
        distance = float(np.nan_to_num(np.linalg.norm(place - start[:2])))
        duration = _SIDE_DURATION * max(
            MINIMUM_JERK_SPEED * distance / MAX_SPEED,
            math.sqrt(MINIMUM_JERK_ACCELERATION * distance / MAX_ACCELERATION),
        )
        self._descents[number] = _Descent(start, place, duration, time, time)
        return distance

    def reference(self, number: int, time: float, z: float, z_dot: float) -> list[float] | None:
        """Return x, y, z (m), x_dot, y_dot, z_dot (m/s); None if the vehicle lands where it is.

        The descent straight down, z (m) and z_dot (m/s) at a time (s), takes effect in proportion
        to the completed part of the move sideways: at first the vehicle keeps its height.
        """
        descent = self._descents[number]
        descent.last = time
        if descent.duration == 0.0:
            return None
        s = min((time - descent.begin) / descent.duration, 1.0)
        done, slope = minimum_jerk(s)
        path = np.array([*descent.place, z]) - descent.start
        velocity = slope / descent.duration * path + done * np.array([0.0, 0.0, z_dot])
        return [*(descent.start + done * path).tolist(), *velocity.tolist()]
