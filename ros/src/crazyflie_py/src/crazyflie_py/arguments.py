"""Checks of the arguments of Crazyswarm's API.

Each function returns the value as a plain type, or raises ValueError with the method, the argument,
the value and what was expected.
"""

import math
import numbers
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from crazyflie_model.angles import Triple
from crazyflie_model.polynomials import COEFFICIENTS, PolynomialPiece
from crazyflie_utils.parameters.types import Integer, Number, ParameterType
from crazyflie_utils.text import shown


def number(
    where: str, name: str, value: Any, low: float = -math.inf, high: float = math.inf
) -> float:
    """Return a finite number from ``low`` to ``high``."""
    return float(_checked(where, name, value, Number(minimum=low, maximum=high)))


def integer(where: str, name: str, value: Any, low: int, high: int) -> int:
    """Return an integer from ``low`` to ``high``."""
    return int(_checked(where, name, value, Integer(low, high)))


def _checked(where: str, name: str, value: Any, kind: ParameterType) -> Any:
    """Return a number of a type, also one in an array of size 1."""
    plain = value.item() if isinstance(value, np.ndarray) and value.size == 1 else value
    if isinstance(plain, str):
        raise _error(where, name, value, str(kind))
    try:
        return kind(float(plain) if isinstance(plain, numbers.Real) else plain)
    except ValueError:
        raise _error(where, name, value, str(kind)) from None


def rate(value: Any) -> float:
    """Return the rate (Hz) of ``timeHelper.sleepForRate``."""
    return number("timeHelper.sleepForRate", "rateHz", value, 1e-3, 1e5)


def byte(where: str, name: str, value: Any) -> int:
    """Return an integer from 0 to 255, as ids and masks are."""
    return integer(where, name, value, 0, 255)


def triple(where: str, name: str, value: Any, low: float = -math.inf) -> Triple:
    """Return three finite numbers, each at least ``low``."""
    expected = "three finite numbers" + (f" >= {low:g}" if low > -math.inf else "")
    parts = corner(where, name, value, expected)
    if not all(math.isfinite(part) and part >= low for part in parts):
        raise _error(where, name, value, expected)
    return parts


def corner(where: str, name: str, value: Any, expected: str = "three numbers") -> Triple:
    """Return three numbers, which may be infinite."""
    try:
        x, y, z = map(float, value)
    except (TypeError, ValueError):
        x = y = z = math.nan
    if any(map(math.isnan, (x, y, z))):
        raise _error(where, name, value, expected)
    return x, y, z


def pieces(where: str, trajectory: Any) -> list[PolynomialPiece]:
    """Return the pieces of a `uav_trajectory.Trajectory`."""
    found = getattr(trajectory, "polynomials", None)
    if found is not None and len(found) == 0:
        raise ValueError(f"{where}: trajectory has no pieces; expected one at least")
    if found is None:
        raise _error(where, "trajectory", trajectory, "a uav_trajectory.Trajectory with pieces")
    result = []
    for index, piece in enumerate(found):
        duration = number(where, f"duration of piece {index}", piece.duration, 1e-3)
        axes = []
        for name in ("x", "y", "z", "yaw"):
            axis = np.asarray(getattr(piece, f"p{name}").p, dtype=float)
            axes.append(axis.tolist())
            if len(axis) > COEFFICIENTS or not np.all(np.isfinite(axis)):
                expected = f"at most {COEFFICIENTS} finite coefficients"
                raise _error(where, f"{name} of piece {index}", axis, expected)
        result.append(PolynomialPiece(duration, *axes))
    return result


def instances(where: str, name: str, values: Any, expected: type) -> list[Any]:
    """Return a list of objects of a class."""
    found = list(values) if isinstance(values, Iterable) else None
    if found is None or not all(isinstance(value, expected) for value in found):
        raise _error(where, name, values, f"a list of {expected.__name__}")
    return found


def parameter_name(where: str, value: Any) -> str:
    """Return "group.name" for the name of a firmware parameter, with a point or a slash."""
    parts = str(value).replace("/", ".").split(".")
    if isinstance(value, str) and len(parts) == 2 and all(parts):
        return ".".join(parts)
    raise _error(where, "name", value, "GROUP/NAME or GROUP.NAME")


def parameters(where: str, values: Any) -> dict[str, float]:
    """Return firmware parameters, "group.name" -> value."""
    if not isinstance(values, Mapping):
        raise _error(where, "params", values, "a dictionary: name -> value")
    checked = {}
    for name, value in values.items():
        key = parameter_name(where, name)
        is_integer = isinstance(value, numbers.Integral)
        checked[key] = int(value) if is_integer else number(where, key, value)
    return checked


def _error(where: str, name: str, value: Any, expected: str) -> ValueError:
    value = value.tolist() if isinstance(value, np.ndarray) else value
    value = list(value) if isinstance(value, Sequence) and not isinstance(value, str) else value
    return ValueError(f"{where}: {name} is {shown(value)}; expected {expected}")
