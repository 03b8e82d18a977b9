"""Functions that scripts use: Crazyswarm's pycrazyswarm.util."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def normalize(a: ArrayLike, axis: int | None = None) -> Array:
    """Return an array divided by its norms along an axis; zeros stay zeros."""
    norms = np.linalg.norm(a, axis=axis, keepdims=True)
    return np.asarray(a) / np.where(norms > 0.0, norms, 1.0)


def clamp_norm(x: ArrayLike, limit: float) -> Array:
    """Return a vector, shortened to a norm if it is longer."""
    norm = float(np.linalg.norm(x))
    return np.asarray(x, dtype=float) * (limit / norm if norm > limit else 1.0)


def check_ellipsoid_collisions(positions: ArrayLike, radii: ArrayLike) -> NDArray[np.bool_]:
    """Return which of n equal ellipsoids, parallel to the axes, intersect another one.

    Parameters
    ----------
    positions : array_like, shape (n, 3)
        Centres, m.
    radii : array_like, shape (3,)
        Semi-axes, m.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    scaled = np.asarray(positions, dtype=float) / np.asarray(radii, dtype=float)
    distances = np.linalg.norm(scaled[:, None] - scaled[None, :], axis=-1)
    np.fill_diagonal(distances, np.inf)
    return np.any(distances < 2.0, axis=1)


def poisson_disk_sample(n: int, dim: int, mindist: float) -> Array:
    """Return n random points in ``dim`` dimensions, no two closer than ``mindist``.

    From numpy's global generator, in a cube about the origin that has room for 1.25 n cubes of
    edge ``mindist``. Points that are too close are drawn again.
    """
    edge = (1.25 * n) ** (1.0 / dim) * mindist
    points: list[Array] = []
    while len(points) < n:
        point = edge * np.random.uniform(-0.5, 0.5, size=dim)
        if all(np.linalg.norm(point - other) >= mindist for other in points):
            points.append(point)
    return np.array(points)


def grid_yaml(rows: int, cols: int, spacing: float = 0.5) -> str:
    """Return the text of a crazyflies.yaml: vehicles on the ground, about the origin.

    Rows are along x, columns along y, ``spacing`` (m) apart; ids count from 0.
    """
    lines = ["crazyflies:"]
    for number in range(rows * cols):
        row, column = divmod(number, cols)
        x, y = spacing * (row - (rows - 1) / 2), spacing * (column - (cols - 1) / 2)
        lines += [f"- channel: 100\n  id: {number}\n  initialPosition: [{x}, {y}, 0.0]"]
    return "\n".join(lines)
