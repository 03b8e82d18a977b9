"""Where a vehicle must not be: there its motors are stopped."""

import math
from dataclasses import dataclass

PERSISTENCE = 0.1
"""How long a limit has to be exceeded, s: a single measurement that is wrong is no crash."""

FRESHNESS = 0.2
"""A measurement that is older does not count, s."""


@dataclass(frozen=True)
class Box:
    """The geofence's box.

    Attributes
    ----------
    lower, upper : tuple of float, length 3
        Corners, m, fixed frame; infinite where there is no wall.
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]

    def excess(self, position: tuple[float, ...]) -> float:
        """Return how far a position is outside along the worst axis, m; negative inside."""
        axes = zip(position, self.lower, self.upper, strict=True)
        return max(max(low - x, x - high) for x, low, high in axes)


@dataclass(frozen=True)
class Limits:
    """What a vehicle in flight does not exceed.

    Attributes
    ----------
    box : Box
    outside : float
        How far outside the box is too far, m.
    floor : float
        Lowest z, m, fixed frame.
    """

    box: Box
    outside: float
    floor: float

    def of_position(self, position: tuple[float, ...]) -> str:
        """Return in words what is wrong with a position (m); nothing if nothing is."""
        if position[2] < self.floor:
            return f"{-position[2]:.2f} m below the ground"
        excess = self.box.excess(position)
        return f"{excess:.2f} m outside the geofence" if excess > self.outside else ""


class Persistence:
    """A complaint that is renewed with every measurement, and how long it has lasted."""

    def __init__(self) -> None:
        self._text = ""
        self._age = math.inf
        self._lasted = 0.0

    @property
    def is_wrong(self) -> bool:
        """Whether the latest measurement was wrong."""
        return bool(self._text)

    def measure(self, text: str) -> None:
        """Take what is wrong by the latest measurement, or an empty text."""
        self._text = text
        self._age = 0.0

    def advance(self, step: float) -> str:
        """Let time pass (s); return what has been wrong for `PERSISTENCE`, or an empty text."""
        self._age += step
        is_wrong = self._text and self._age < FRESHNESS
        self._lasted = self._lasted + step if is_wrong else 0.0
        return self._text if self._lasted > PERSISTENCE else ""
