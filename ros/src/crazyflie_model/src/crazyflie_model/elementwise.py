"""One vehicle in floats or many in arrays, by the same formulas.

The models take a state or a control as the list of its *components*: floats
for one vehicle, on which Python is several times quicker than numpy; arrays of
shape (n,), or of any shape that broadcasts, for many. The differences between the
two are in this module. Any other type that supports numpy's ``sin``, ``where``
and ``clip`` (NEP 13, NEP 18) is accepted as well.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import ModuleType, SimpleNamespace
from typing import TypeAlias, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: A component of many vehicles: an array, or a float that is the same for all of them.
Many: TypeAlias = float | NDArray[np.float64]
#: A component of one vehicle or of many: results of floats only are floats.
Number = TypeVar("Number", float, Many)
#: The components of a state, a control or a vector: ``Vector[float]`` is one vehicle's.
Vector = list[Number]


def split(vectors: ArrayLike) -> Vector[Many]:
    """Return the m components, float or shape (...), of vectors of shape (m,) or (..., m)."""
    vectors = np.asarray(vectors, dtype=float)
    return vectors.tolist() if vectors.ndim == 1 else list(np.moveaxis(vectors, -1, 0))


def join(components: Sequence[Many]) -> NDArray[np.float64]:
    """Return components as one array, shape (m,) or (..., m); inverse of `split`."""
    return np.stack(np.broadcast_arrays(*components), axis=-1)


#: numpy's functions by math's names, which numpy itself has since version 2 only.
NUMPY_FUNCTIONS = SimpleNamespace(
    sin=np.sin,
    cos=np.cos,
    tan=np.tan,
    sqrt=np.sqrt,
    hypot=np.hypot,
    asin=np.arcsin,
    atan2=np.arctan2,
)


def functions(value: Many) -> ModuleType | SimpleNamespace:
    """Return math, or numpy under the same names, whose sin, cos, ... take ``value``."""
    return math if isinstance(value, float) else NUMPY_FUNCTIONS


@overload
def where(condition: bool, value: float, other: float) -> float: ...


@overload
def where(condition: bool | NDArray[np.bool_], value: Many, other: Many) -> Many: ...


def where(condition: bool | NDArray[np.bool_], value: Many, other: Many) -> Many:
    """Return ``value`` where a condition, bool or array of bool, holds, else ``other``."""
    if isinstance(condition, bool):
        return value if condition else other
    if isinstance(condition, np.bool_):
        return value if condition else other
    return np.where(condition, value, other)


def nowhere(condition: bool | NDArray[np.bool_]) -> bool:
    """Return whether a condition is known to be false for all vehicles: nothing is computed."""
    if isinstance(condition, bool):
        return not condition
    return isinstance(condition, np.ndarray) and not condition.any()


def clip(value: Number, low: Number, high: Number) -> Number:
    """Return ``value`` limited to [low, high]."""
    if isinstance(value, float):
        return low if value < low else high if value > high else value
    if type(value) is np.ndarray:
        # The same as np.clip, in a fraction of its time; a NaN stays.
        return np.minimum(np.maximum(value, low), high)
    return np.clip(value, low, high)
