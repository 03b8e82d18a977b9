"""Step 3: a path through a rectangle: parallel lanes with arcs between them."""

import bisect
import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

from typing_extensions import override

from crazyflie_sweep.sweep_parameters import Area

Point = tuple[float, float, float]  #: x, y, z in m.

_SLACK = 1e-9


class Segment(ABC):
    """A piece of a path, of a ``length`` in m."""

    length: float

    @abstractmethod
    def at(self, s: float) -> tuple[Point, Point]:
        """Return position (m) and direction (unit vector) after ``s`` metres of it."""


class Line(Segment):
    """A straight piece.

    Parameters
    ----------
    begin, end : Point
        Two different ones.
    is_lane : bool
        Whether it sweeps the area; otherwise it only leads somewhere.
    """

    def __init__(self, begin: Point, end: Point, is_lane: bool = True):
        self.begin = begin
        self.end = end
        self.is_lane = is_lane
        self.length = math.dist(begin, end)
        ux, uy, uz = ((e - b) / self.length for b, e in zip(begin, end, strict=True))
        self._direction = (ux, uy, uz)

    @override
    def at(self, s: float) -> tuple[Point, Point]:
        return self._point(s), self._direction

    def distance(self, point: Point) -> float:
        """Return how far a point is from the line between its ends, m."""
        offset = (p - b for p, b in zip(point, self.begin, strict=True))
        along = sum(o * u for o, u in zip(offset, self._direction, strict=True))
        return math.dist(point, self._point(min(max(along, 0.0), self.length)))

    def _point(self, s):
        x, y, z = self.begin
        ux, uy, uz = self._direction
        return x + s * ux, y + s * uy, z + s * uz


class Arc(Segment):
    """A circular piece, horizontal.

    Parameters
    ----------
    centre : Point
    radius : float
        m.
    begin : float
        Angle of its first point as seen from the centre, rad.
    turn : float
        Angle to its last one, rad; positive is counter-clockwise.
    """

    def __init__(self, centre: Point, radius: float, begin: float, turn: float):
        self.centre = centre
        self.radius = radius
        self.begin = begin
        self.turn = turn
        self.length = radius * abs(turn)

    @override
    def at(self, s: float) -> tuple[Point, Point]:
        raise NotImplementedError("step 3b")


class LanePath:
    """Segments, one behind the other; at least one."""

    def __init__(self, segments: Sequence[Segment]):
        self.segments = tuple(segments)
        self._begins = [0.0, *itertools.accumulate(segment.length for segment in segments)]

    @property
    def length(self) -> float:
        """Of all segments, m."""
        return self._begins[-1]

    def segment_at(self, s: float) -> Segment:
        """Return the segment after ``s`` metres of the path; the last one beyond its end."""
        return self.segments[self._number(s)]

    def at(self, s: float) -> tuple[Point, Point]:
        """Return position (m) and direction (unit vector) after ``s`` metres, within the path."""
        number = self._number(s)
        segment = self.segments[number]
        return segment.at(min(max(s - self._begins[number], 0.0), segment.length))

    def _number(self, s):
        return min(max(bisect.bisect_right(self._begins, s) - 1, 0), len(self.segments) - 1)


def lane_offsets(width: float, lane_width: float) -> list[float]:
    """Return where lanes lie beside each other, from one side of a strip, m.

    They are as many as are needed, and equally far apart: at most ``lane_width``.
    """
    raise NotImplementedError("step 3a")


def sweep(area: Area, lane_width: float, height: float) -> LanePath:
    """Return the path that sweeps an area: along x, an arc, back along x, and so on.

    Lanes are at most ``lane_width`` (m) apart. The arcs are outside of the area: they reach half
    the distance of two lanes beyond its ends.
    """
    raise NotImplementedError("step 3c")
