"""Where a vehicle must not be: there its motors are stopped."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Box:
    """The geofence's box: corners, m, fixed frame; infinite where there is no wall."""

    lower: tuple[float, ...]
    upper: tuple[float, ...]

    def excess(self, position: tuple[float, ...]) -> float:
        """Return how far a position is outside along the worst axis, m; negative inside."""
        axes = zip(position, self.lower, self.upper, strict=True)
        return max(max(low - x, x - high) for x, low, high in axes)

    def without_floor(self) -> "Box":
        """Return the box open below: a takeoff begins below many a fence."""
        return Box((*self.lower[:2], -math.inf), self.upper)


NO_BOX = Box((-math.inf,) * 3, (math.inf,) * 3)


@dataclass(frozen=True)
class Limits:
    """Limits of a vehicle in flight."""

    box: Box  # Of the geofence at the start.
    outside: float  # Largest distance outside the box, m.
    floor: float  # Lowest z, m, fixed frame.
    climb: float  # Largest z_dot that controls may reach, m/s.
    height: float  # Largest height above the ground that controls may reach, m.


class Walls:
    """The box, which may change in flight, and what lies outside of it.

    A vehicle that new walls leave outside may come back: as far outside as it was is not too far.
    """

    def __init__(self, limits: Limits):
        self._limits = limits
        self._box = limits.box
        self._granted = 0.0
        self._position: tuple[float, ...] | None = None

    def change(self, box: Box) -> None:
        """Take another box."""
        self._box = box
        if self._position is not None:
            self._granted = max(box.excess(self._position), 0.0)

    def complaint(self, position: tuple[float, ...]) -> str:
        """Return in words what is wrong with a measured position (m); nothing if nothing is."""
        self._position = position
        if position[2] < self._limits.floor:
            return f"{-position[2]:.2f} m below the ground"
        excess = self._box.excess(position)
        self._granted = max(min(self._granted, excess), 0.0)
        too_far = excess > self._limits.outside + self._granted
        return f"{excess:.2f} m outside the geofence" if too_far else ""

    def highest(self, ground: float) -> float:
        """Return the z that controls may climb to, m, above a ground at z = ``ground`` (m)."""
        # The fence, which leaves the vehicle a little room above the wall, comes first.
        ceiling = self._box.upper[2] + 0.5 * self._limits.outside
        return min(ground + self._limits.height, ceiling)


class Debounce:
    """Lets a complaint through that lasts longer than ``duration``, s."""

    def __init__(self, duration: float):
        self._duration = duration
        self._lasted = 0.0

    def advance(self, step: float, complaint: str) -> str:
        """Let time pass (s); return the complaint if it has lasted long enough, else no text."""
        self._lasted = self._lasted + step if complaint else 0.0
        return complaint if self._lasted > self._duration else ""
