"""Limits of missions: demands on a vehicle, and the box that it may fly in."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST
from crazyflie_model.units import GRAVITY

Array = NDArray[np.float64]


class MissionError(Exception):
    """A mission cannot be flown; the text names what, its value, and what was expected."""


@dataclass(frozen=True)
class Limits:
    """Largest demands of a trajectory on a vehicle."""

    #: speed, acceleration: m/s, m/s^2.
    speed: float = 0.5
    acceleration: float = 1.0
    yaw_rate: float = 1.5  #: rad/s.
    #: Of the thrust against the vertical, rad; as much as controllers ask for.
    tilt: float = MAX_TILT
    #: min_thrust, max_thrust: m/s^2, as much as controllers ask for.
    min_thrust: float = MIN_THRUST
    max_thrust: float = MAX_THRUST

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, value in vars(self).items():
            number(value, f"limits: {name}", above=0.0)
        if not self.min_thrust < GRAVITY < self.max_thrust:
            raise MissionError(
                f"limits: min_thrust is {self.min_thrust:g}, and max_thrust {self.max_thrust:g}; "
                f"expected one below and one above {GRAVITY:g} m/s^2, which hovers"
            )


@dataclass(frozen=True)
class Bounds:
    """The box that vehicles may fly in."""

    #: lower, upper: Its corners, m, in the frame of the vehicles' states.
    lower: tuple[float, float, float]
    upper: tuple[float, float, float]

    def __post_init__(self) -> None:
        """Check the corners."""
        try:
            corners = np.array([self.lower, self.upper], dtype=float)
        except (TypeError, ValueError):
            corners = np.empty(0)
        if corners.shape != (2, 3) or not (corners[0] < corners[1]).all():
            raise MissionError(
                f"bounds are {self.lower!r} to {self.upper!r} m; expected a lower and an upper "
                "corner x, y, z"
            )

    def within(self, other: "Bounds") -> "Bounds":
        """Return the box that is in both."""
        lower = np.maximum(self.lower, other.lower).tolist()
        return Bounds(tuple(lower), tuple(np.minimum(self.upper, other.upper).tolist()))

    def check(self, positions: Array, what: str) -> None:
        """Refuse positions outside.

        Parameters
        ----------
        positions : ndarray, shape (3,) or (n, 3)
            m.
        what : str
            What they are, for the text of the error.

        Raises
        ------
        MissionError
        """
        for axis, name in enumerate("xyz"):
            values = np.atleast_2d(positions)[:, axis]
            for value in (values.min(), values.max()):
                if not self.lower[axis] - 1e-6 <= value <= self.upper[axis] + 1e-6:
                    raise MissionError(
                        f"{what} is out of bounds: {name} is {value:.3g} m; expected "
                        f"{self.lower[axis]:g} to {self.upper[axis]:g} m"
                    )


#: Above the ground.
EVERYWHERE = Bounds((-math.inf, -math.inf, 0.0), (math.inf, math.inf, math.inf))


def point(value: Sequence[float], what: str) -> Array:
    """Return a point of a user as an array, shape (3,), m.

    Raises
    ------
    MissionError
        It is no three finite numbers.
    """
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise MissionError(f"{what} is {value!r}; expected x, y, z in m, finite numbers")
    return array


def number(value: float, what: str, minimum: float = -math.inf, above: float = -math.inf) -> float:
    """Return a finite number that is ``minimum`` at least, and more than ``above``.

    Raises
    ------
    MissionError
    """
    if isinstance(value, int | float | np.floating | np.integer) and not isinstance(value, bool):
        as_float = float(value)
        if math.isfinite(as_float) and as_float >= minimum and as_float > above:
            return as_float
    bound = "" if minimum == -math.inf else f" >= {minimum:g}"
    if above > -math.inf:
        bound += f" > {above:g}"
    raise MissionError(f"{what} is {value!r}; expected a finite number{bound}")
