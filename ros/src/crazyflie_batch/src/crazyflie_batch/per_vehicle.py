"""Ranges and shapes of numbers that may differ between vehicles."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def check_range(name: str, values: ArrayLike, low: float, high: float = math.inf) -> None:
    """Raise ValueError with the first number outside [low, high]; `columns` refuses NaN."""
    expected = f"at least {low:g}" if math.isinf(high) else f"{low:g} to {high:g}"
    array = np.asarray(values, dtype=float)
    _refuse(name, array[(array < low) | (array > high)], expected)


def check_above(name: str, values: ArrayLike, limit: float) -> None:
    """Raise ValueError with the first number that is not above a limit; `columns` refuses NaN."""
    array = np.asarray(values, dtype=float)
    _refuse(name, array[array <= limit], f"more than {limit:g}")


def _refuse(name, wrong, expected):
    if len(wrong):
        raise ValueError(f"{name} is {wrong[0]:g}; expected {expected}")


def stacked_columns(values: Mapping[str, ArrayLike], n: int) -> NDArray[np.float64]:
    """Return numbers or arrays (n,), by name, as one array (len(values), n); see `columns`."""
    parts = [columns(name, value, (), n) for name, value in values.items()]
    return np.concatenate([np.empty((0, n)), *parts])


def columns(name: str, values: Any, shape: tuple[int, ...], n: int) -> NDArray[np.float64]:
    """Return an array of shape ``shape`` or (n, *shape) as one of shape (size, n).

    ValueError: it has another shape, or is not finite.
    """
    array = np.asarray(values, dtype=float)
    if array.shape not in (shape, (n, *shape)):
        raise ValueError(f"{name} has the shape {array.shape}; expected {shape} or {(n, *shape)}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} is not finite")
    return np.broadcast_to(array, (n, *shape)).reshape(n, -1).T
