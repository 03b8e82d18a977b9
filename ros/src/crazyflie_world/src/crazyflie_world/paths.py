"""Known paths of things that move."""

import math
from dataclasses import dataclass

import numpy as np

Position = tuple[float, float, float]
"""x, y, z in m."""


class Path:
    """Where something is, over time."""

    def position(self, time: float) -> Position:
        """Return where it is ``time`` seconds after it began; until then it waits there."""
        raise NotImplementedError


@dataclass(frozen=True)
class Circle(Path):
    """A horizontal circle at constant speed.

    Attributes
    ----------
    centre : tuple of float
        m.
    radius : float
        m.
    period : float
        s.
    phase : float
        Where it begins, rad from the x axis.
    clockwise : bool
        As seen from above.
    """

    centre: Position
    radius: float
    period: float
    phase: float = 0.0
    clockwise: bool = False

    def position(self, time: float) -> Position:
        """See `Path.position`."""
        turned = 2.0 * math.pi * max(time, 0.0) / self.period
        angle = self.phase + (-turned if self.clockwise else turned)
        x, y, z = self.centre
        return x + self.radius * math.cos(angle), y + self.radius * math.sin(angle), z


@dataclass(frozen=True)
class Waypoints(Path):
    """Straight from point to point, each at its time.

    Attributes
    ----------
    times : tuple of float
        s; the first is 0, each larger than the one before.
    points : tuple of Position
        As many.
    repeat : bool
        Whether it begins again after the last point; otherwise it stays there.
    """

    times: tuple[float, ...]
    points: tuple[Position, ...]
    repeat: bool = True

    def position(self, time: float) -> Position:
        """See `Path.position`."""
        if self.repeat and time > 0.0:
            time %= self.times[-1]
        x, y, z = (
            float(np.interp(time, self.times, axis)) for axis in zip(*self.points, strict=True)
        )
        return x, y, z
