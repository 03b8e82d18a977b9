"""Formations: their places, and the assignment of vehicles to them."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from crazyflie_fleet.separation import SCALE
from crazyflie_mission_api.limits import Array

Point = tuple[float, float, float]


def lattice(
    counts: tuple[int, int, int],
    spacing: float | Sequence[float],
    center: Sequence[float] = (0.0, 0.0, 1.0),
) -> Array:
    """Return the places of a box of vehicles about a centre (m), shape (n, 3), m.

    ``counts`` are the numbers along x, y and z; ``spacing`` is the distance of neighbours (m), one
    or one for each axis.
    """
    spacings = np.broadcast_to(spacing, 3)
    axes = [
        step * (np.arange(count) - (count - 1) / 2.0)
        for count, step in zip(counts, spacings, strict=True)
    ]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3) + center


def circle(n: int, radius: float, center: Sequence[float] = (0.0, 0.0, 1.0)) -> Array:
    """Return ``n`` places on a circle about a vertical axis, shape (n, 3), m."""
    angles = 2.0 * math.pi * np.arange(n) / n
    flat = np.stack([radius * np.cos(angles), radius * np.sin(angles), np.zeros(n)], axis=1)
    return flat + center


def assign(places: Mapping[str, Sequence[float]], goals: Array) -> dict[str, Point]:
    """Assign goals to vehicles with the least sum of squared distances.

    Vehicles that then fly there on straight lines, with the same time law, stay at least this far
    apart: min(start distance, goal distance) / sqrt(2), distances as in `Clearance`: Turpin,
    Michael and Kumar, CAPT: Concurrent Assignment and Planning of Trajectories for Multiple Robots
    (IJRR 2014). ``places`` are the positions by vehicle (m), ``goals`` as many, shape (n, 3), m.
    """
    starts = np.array([*places.values()], dtype=float)
    squares = cdist(starts * SCALE, goals * SCALE, "sqeuclidean")
    rows, columns = linear_sum_assignment(squares)
    names = [*places]
    return {names[row]: tuple(goals[column]) for row, column in zip(rows, columns, strict=True)}
