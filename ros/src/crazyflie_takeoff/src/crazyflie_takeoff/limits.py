"""Where a vehicle must not be, and how it must not lie: there its motors are stopped."""

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
    tilt : float
        Largest angle between the vehicle's vertical axis and the fixed one, rad.
    """

    box: Box
    outside: float
    floor: float
    tilt: float

    def of_position(self, position: tuple[float, ...]) -> str:
        """Return in words what is wrong with a position (m); nothing if nothing is."""
        if position[2] < self.floor:
            return f"{-position[2]:.2f} m below the ground"
        excess = self.box.excess(position)
        return f"{excess:.2f} m outside the geofence" if excess > self.outside else ""

    def of_attitude(self, tilt: float) -> str:
        """Return in words what is wrong with a tilt (rad); nothing if nothing is."""
        return f"tilted by {math.degrees(tilt):.0f} degrees" if tilt > self.tilt else ""


def tilt_of(quaternion: tuple[float, float, float, float]) -> float:
    """Return the angle between the body's z axis and the fixed one, rad.

    Parameters
    ----------
    quaternion : tuple
        x, y, z, w, of any length but zero; of zero length it says nothing, and the tilt is 0.
    """
    x, y, z, w = quaternion
    square = x * x + y * y + z * z + w * w
    if square == 0.0:
        return 0.0
    return math.acos(max(-1.0, 1.0 - 2.0 * (x * x + y * y) / square))


class Persistence:
    """A complaint that is renewed with every measurement, and how long it has lasted."""

    def __init__(self) -> None:
        self._text = ""
        self._age = math.inf
        self._lasted = 0.0

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
