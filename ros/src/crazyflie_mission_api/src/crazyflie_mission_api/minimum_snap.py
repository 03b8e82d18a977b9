"""Trajectories of minimum snap through waypoints.

Of all curves that pass points at given times, at rest at both ends, the one with the least
integral of the squared fourth derivative (snap) is the spline of degree 7 whose first three
derivatives vanish at the ends: the theorem of Holladay for splines of odd degree (de Boor, A
Practical Guide to Splines). So scipy's interpolation calculates it, and a vehicle's memory can
hold its pieces.

For a given total time, the durations between waypoints are chosen for the least snap, too.
Otherwise the curve swings out far beyond its waypoints. Both are from Mellinger and Kumar, Minimum
Snap Trajectory Generation and Control for Quadrotors (ICRA 2011).
"""

import itertools
import math
from collections.abc import Sequence

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.optimize import minimize

from crazyflie_mission_api.limits import Array, Limits, MissionError
from crazyflie_mission_api.trajectories import within_limits
from crazyflie_model.polynomials import COEFFICIENTS, PolynomialPiece

_REST = [(order, np.zeros(4)) for order in (1, 2, 3)]

#: Gauss's rule of 4 points is exact up to degree 7; squared snap has degree 6.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)
_ITERATIONS = 20  #: Number of iterations of the search for the times; later ones change little.
_NEAREST = 1e-3  #: Distance below which two waypoints are the same (m or rad).


def plan(
    waypoints: Sequence[Sequence[float]], limits: Limits | None = None, what: str = "waypoint"
) -> list[PolynomialPiece]:
    """Return the trajectory from rest at the first waypoint to rest at the last one.

    It is as fast as the limits allow. A waypoint is x, y, z (m) or x, y, z, yaw (rad); without a
    yaw it has that of the one before, or 0. `MissionError`: there are fewer than two, one is
    invalid, or two in a row are the same; ``what`` is the name of a waypoint in it.
    """
    points = _points(waypoints, what)
    return within_limits(_pieces(points, best_times(points)), limits or Limits())


def best_times(points: Array) -> Array:
    """Return the times of points as fractions of the total time, shape (n,).

    The points, shape (n, 4), are x, y, z (m) and yaw (rad).
    """
    distances = np.linalg.norm(np.diff(points, axis=0), axis=1)

    def log_snap(log_spans):
        return math.log(_snap(points, _times(log_spans)))

    start = np.log(distances) / 2.0
    found = minimize(log_snap, start, method="L-BFGS-B", options={"maxiter": _ITERATIONS})
    return _times(found.x)


def _times(log_spans):
    ends = np.cumsum(np.exp(log_spans - log_spans.max()))
    return np.concatenate([[0.0], ends / ends[-1]])


def _spline(points, times):
    return make_interp_spline(times, points, k=7, bc_type=(_REST, _REST))


def _snap(points, times):
    snap: BSpline = _spline(points, times).derivative(4)
    half = np.diff(times)[:, np.newaxis] / 2.0
    nodes = times[:-1, np.newaxis] + half * (1.0 + _NODES)
    return float(((snap(nodes) ** 2).sum(axis=-1) * half * _WEIGHTS).sum())


def _pieces(points, times):
    curve = _spline(points, times)
    # Taylor's series about the beginning of each piece; shape (pieces, axes, coefficients).
    taylor = np.stack(
        [curve(times[:-1], nu=k) / math.factorial(k) for k in range(COEFFICIENTS)], axis=-1
    )
    return [
        PolynomialPiece(float(span), *axes.tolist())
        for span, axes in zip(np.diff(times), taylor, strict=True)
    ]


def _points(waypoints, what):
    points: list[list[float]] = []
    for number, waypoint in enumerate(waypoints, start=1):
        try:
            values = [float(value) for value in waypoint]
        except (TypeError, ValueError):
            values = []
        if len(values) not in (3, 4) or not all(map(math.isfinite, values)):
            raise MissionError(
                f"{what} {number} is {waypoint!r}; expected finite numbers: x, y, z in m, and "
                "optionally yaw in rad"
            )
        yaw = values[3:] or [points[-1][3] if points else 0.0]
        points.append([*values[:3], *yaw])
    if len(points) < 2:
        raise MissionError(f"the number of {what}s is {len(points)}; expected at least 2")
    for number, (one, two) in enumerate(itertools.pairwise(points), start=1):
        if math.dist(one, two) < _NEAREST:
            raise MissionError(
                f"{what} {number} is {tuple(one)}, and {number + 1} is the same; expected "
                "different points"
            )
    return np.array(points)
