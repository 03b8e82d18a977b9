"""Known paths of things that move."""

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from typing_extensions import override

from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.types import BOOLEAN, FINITE, POSITION, TIME_STEP, ListOf, Number

Position = tuple[float, float, float]  #: x, y, z in m.


class Path(Parameters):
    """Where something is, over time; as declared in a world file."""

    def position(self, time: float) -> Position:
        """Return where it is ``time`` seconds after it began; until then it waits there."""
        raise NotImplementedError


class Circle(Path):
    """A horizontal circle at constant speed."""

    centre: Position = parameter(POSITION, "of the circle")
    radius: float = parameter(Number("m", above=0.0), "of the circle")
    period: float = parameter(TIME_STEP, "of one round")
    phase: float = parameter(Number("rad"), "where it begins, from the x axis", 0.0)
    clockwise: bool = parameter(BOOLEAN, "direction, as seen from above", False)

    @override
    def position(self, time: float) -> Position:
        turned = 2.0 * math.pi * max(time, 0.0) / self.period
        angle = self.phase + (-turned if self.clockwise else turned)
        x, y, z = self.centre
        return x + self.radius * math.cos(angle), y + self.radius * math.sin(angle), z


class Waypoints(Path):
    """Straight from point to point, each at its time."""

    points: tuple[tuple[float, ...], ...] = parameter(
        ListOf(ListOf(FINITE, 4)), "[time, x, y, z], s and m"
    )
    repeat: bool = parameter(BOOLEAN, "begin again after the last; otherwise stay there", True)

    @override
    def complaints(self) -> Iterator[str]:
        times = [point[0] for point in self.points]
        if len(times) < 2:
            yield f"points are {len(times)}; expected two or more"
        elif times[0] != 0.0 or any(a >= b for a, b in pairwise(times)):
            yield f"the times of points are {times}; expected each larger than the last, from 0 (s)"
        elif self.repeat and self.points[0][1:] != self.points[-1][1:]:
            yield (
                f"the last of points is {list(self.points[-1][1:])}; expected the first, "
                f"{list(self.points[0][1:])} (m), where the path begins again"
            )

    @override
    def position(self, time: float) -> Position:
        times, *axes = zip(*self.points, strict=True)
        if self.repeat and time > 0.0:
            time %= times[-1]
        x, y, z = (float(np.interp(time, times, axis)) for axis in axes)
        return x, y, z
