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

    def scene(self) -> "tuple[Sequence[str], Scene]":
        """Return the names of the vehicles whose positions are known, and these vehicles."""

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
        if not side.left():
            return
        names, scene = side.scene()
        goals, aside = {}, {}
        for k, (x, y) in scene.next_round().items():
            here = scene.places[k]
            goals[names[k]] = x, y, float(here[2])
            if (x, y) != _pair(here):
                aside[names[k]] = goals[names[k]]
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


class Scene:
    """The vehicles at one moment.

    Parameters
    ----------
    places : ndarray, shape (n, 3)
        Where they are, m.
    lands, is_down : ndarray of bool, shape (n,)
        Which of them are in flight and to land, and which are on the ground, or descend to where
        they are. The others are in flight and stay where they are.
    limits : ndarray, shape (n, n)
        Distances that each two must keep, m; heights are divided by `DOWNWASH`.
    lower, upper : ndarray, shape (n, 2), or float
        Corners x, y of the box that each may land in, m.
    """

    def __init__(
        self,
        places: Array,
        lands: Flags,
        is_down: Flags,
        limits: Array,
        lower: Array | float = -math.inf,
        upper: Array | float = math.inf,
    ) -> None:
        self.places = places
        self._xy, self._z = places[:, :2], places[:, 2]
        self._is_down = is_down
        self._limits = limits
        self._lower, self._upper = (np.broadcast_to(c, self._xy.shape) for c in (lower, upper))
        order = np.lexsort((np.arange(len(places)), self._z)).argsort()
        is_below = order[None, :] < order[:, None]
        is_near = cdist(self._xy, self._xy) < limits - _ROUNDING
        beneath = is_near & is_below
        # A vehicle above, on a table, obstructs a landing as well.
        self._is_obstructed = (is_near & is_down | beneath & ~lands & ~is_down).any(axis=1)
        self._is_lowest = lands & ~(beneath & lands).any(axis=1)

    def next_round(self) -> dict[int, tuple[float, float]]:
        """Return which vehicles land next, and above which points: number to x, y in m.

        The point is where the vehicle is, or a free place, to which all of the round can fly
        straight and at the same time. At least one vehicle, if any is to land. If no path is free,
        one vehicle gets a free place; if no place is free, its own.
        """
        straight = np.flatnonzero(self._is_lowest & ~self._is_obstructed)
        if straight.size:
            return {int(i): _pair(self.places[i]) for i in straight}
        lowest = np.flatnonzero(self._is_lowest)
        lowest = lowest[np.argsort(self._z[lowest], kind="stable")]
        chosen: dict[int, tuple[float, float]] = {}
        for i in lowest.tolist():
            if len(reachable := self._reachable_places(i, chosen)):
                chosen[i] = _pair(reachable[0])
        if not chosen and lowest.size:
            i = int(lowest[0])
            chosen[i] = _pair([*self._free_places(i, {}), self.places[i]][0])
        return chosen

    def landing_place(self, i: int) -> tuple[float, float]:
        """Return where vehicle i, which descends already, lands: x, y in m.

        Its own position if nothing is beneath, or if no free place within `MAX_DETOUR` can be
        reached on a straight line.
        """
        free = self._reachable_places(i, {}, MAX_DETOUR) if self._is_obstructed[i] else []
        return _pair([*free, self.places[i]][0])

    def _reachable_places(self, i, chosen, reach=math.inf):
        free = self._free_places(i, chosen, reach)[:_MAX_CANDIDATES]
        return free[self.are_reachable(i, free, chosen)]

    def _free_places(self, i, chosen, reach=math.inf):
        """Return places to land for vehicle i, the nearest first, shape (m, 2)."""
        step = _PITCH * self._limits[i].max()
        count = math.ceil(min(2.0 * (math.sqrt(len(self._z)) + 1.0) / _PITCH, reach / step))
        axis = step * np.arange(-count, count + 1)
        grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
        grid = self._xy[i] + grid[np.hypot(*grid.T).argsort(kind="stable")]
        grid = grid[((grid >= self._lower[i]) & (grid <= self._upper[i])).all(axis=1)]
        # Vehicles that fly above the start of the landing may be nearer.
        above = np.where(self._is_down, 0.0, np.maximum(self._z - self._z[i], 0.0)) / DOWNWASH
        needed = np.sqrt(np.maximum((_MARGIN * self._limits[i]) ** 2 - above**2, 0.0))
        needed[i] = 0.0
        is_free = (cdist(grid, self._xy) >= needed).all(axis=1)
        if chosen:
            limits = _MARGIN * self._limits[i, [*chosen]]
            is_free &= (cdist(grid, np.array([*chosen.values()])) >= limits).all(axis=1)
        return grid[is_free]

    def are_reachable(
        self, i: int, goals: Array, chosen: Mapping[int, tuple[float, float]]
    ) -> Flags:
        """Return whether vehicle i can fly straight to each goal, shape (m, 2); shape (m,).

        At the same time others fly to the places that are ``chosen`` for them.
        """
        others = np.arange(len(self._z)) != i
        ends = self._xy.copy()
        for j, place in chosen.items():
            ends[j] = place
        # Relative to vehicle i.
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

        ``positions`` are those of all vehicles, shape (n, 3), m, NaN where they are not known;
        ``is_landing``, shape (n,), says which descend, or are on the ground.
        """
        start, places = positions[number].copy(), positions.copy()
        for other, descent in self._descents.items():
            if self.is_under_way(other, time):
                places[other, :2] = descent.place
        known = np.asarray(np.isfinite(places).all(axis=1))
        place = start[:2]
        if known[number]:
            lands = np.arange(len(known)) == number
            is_down, limits = is_landing & ~lands, self._limits[np.ix_(known, known)]
            scene = Scene(places[known], lands[known], is_down[known], limits)
            place = np.array(scene.landing_place(int(known[:number].sum())))
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
