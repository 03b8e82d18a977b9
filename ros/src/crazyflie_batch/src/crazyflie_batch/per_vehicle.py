"""Numbers that vehicles may differ by: their ranges and shapes."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def check_at_least(name: str, values: ArrayLike, minimum: float) -> None:
    """Raise ValueError with the number that is too small; NaN is left to others."""
    array = np.asarray(values, dtype=float)
    _refuse(name, array[array < minimum], f"at least {minimum:g}")


def check_above(name: str, values: ArrayLike, limit: float) -> None:
    """Raise ValueError with the number that is too small; NaN is left to others."""
    array = np.asarray(values, dtype=float)
    _refuse(name, array[array <= limit], f"more than {limit:g}")


def check_probability(name: str, values: ArrayLike) -> None:
    """Raise ValueError with the number that is none; NaN is left to others."""
    array = np.asarray(values, dtype=float)
    _refuse(name, array[(array < 0.0) | (array > 1.0)], "0 to 1")


def together(values: Mapping[str, ArrayLike], n: int) -> NDArray[np.float64]:
    """Return numbers or arrays of shape (n,), by name, as one of shape (len(values), n).

    Raises
    ------
    ValueError
        See `columns`.
    """
    parts = [columns(name, value, (), n) for name, value in values.items()]
    return np.concatenate([np.empty((0, n)), *parts])


def columns(name: str, values: Any, shape: tuple[int, ...], n: int) -> NDArray[np.float64]:
    """Return an array of shape ``shape`` or (n, *shape) as one of shape (size, n).

    Raises
    ------
    ValueError
        It has another shape, or is not finite.
    """
    array = np.asarray(values, dtype=float)
    if array.shape not in (shape, (n, *shape)):
        raise ValueError(f"{name} has the shape {array.shape}; expected {shape} or {(n, *shape)}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} is not finite")
    return np.broadcast_to(array, (n, *shape)).reshape(n, -1).T


def _refuse(name, wrong, expected):
    if len(wrong):
        raise ValueError(f"{name} is {wrong[0]:g}; expected {expected}")
