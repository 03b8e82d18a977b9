"""A path through a rectangle: parallel lanes with arcs between them."""

import bisect
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

from crazyflie_sweep.sweep_parameters import Area

Point = tuple[float, float, float]  #: x, y, z in m.

_SLACK = 1e-9


@dataclass(frozen=True)
class Line:
    """A straight piece between two different points.

    A lane sweeps the area; other pieces only connect lanes.
    """

    begin: Point
    end: Point
    is_lane: bool = True

    @property
    def length(self) -> float:
        """Length (m)."""
        return math.dist(self.begin, self.end)

    def at(self, s: float) -> tuple[Point, Point]:
        """Return position (m) and direction (unit vector) after ``s`` metres of it."""
        ux, uy, uz = ((e - b) / self.length for b, e in zip(self.begin, self.end, strict=True))
        x, y, z = self.begin
        return (x + s * ux, y + s * uy, z + s * uz), (ux, uy, uz)

    def reversed(self) -> "Line":
        """Return the line from its end to its begin."""
        return Line(self.end, self.begin, self.is_lane)

    def distance(self, point: Point) -> float:
        """Return the distance of a point from the line between its ends, m."""
        begin, direction = self.at(0.0)
        along = sum((p - b) * u for p, b, u in zip(point, begin, direction, strict=True))
        return math.dist(point, self.at(min(max(along, 0.0), self.length))[0])


@dataclass(frozen=True)
class Arc:
    """A circular piece, horizontal, of a radius in m.

    ``begin`` is the angle of its first point as seen from the centre, ``turn`` that to its last
    one, rad; positive is counter-clockwise.
    """

    centre: Point
    radius: float
    begin: float
    turn: float

    @property
    def length(self) -> float:
        """Length (m)."""
        return self.radius * abs(self.turn)

    def at(self, s: float) -> tuple[Point, Point]:
        """Return position (m) and direction (unit vector) after ``s`` metres of it."""
        angle = self.begin + self.turn * s / self.length
        cosine, sine = math.cos(angle), math.sin(angle)
        sign = math.copysign(1.0, self.turn)
        x, y, z = self.centre
        position = (x + self.radius * cosine, y + self.radius * sine, z)
        return position, (-sign * sine, sign * cosine, 0.0)

    def reversed(self) -> "Arc":
        """Return the arc from its last point to its first."""
        return Arc(self.centre, self.radius, self.begin + self.turn, -self.turn)


Segment = Line | Arc


class LanePath:
    """Consecutive segments; at least one."""

    def __init__(self, segments: Sequence[Segment]):
        self.segments = tuple(segments)
        self._begins = [0.0, *itertools.accumulate(segment.length for segment in segments)]

    @property
    def length(self) -> float:
        """Length of all segments (m)."""
        return self._begins[-1]

    def segment_at(self, s: float) -> Segment:
        """Return the segment after ``s`` metres of the path; the last one beyond its end."""
        return self.segments[self._number(s)]

    def at(self, s: float) -> tuple[Point, Point]:
        """Return position (m) and direction (unit vector) after ``s`` metres, within the path."""
        number = self._number(s)
        segment = self.segments[number]
        return segment.at(min(max(s - self._begins[number], 0.0), segment.length))

    def reversed(self) -> "LanePath":
        """Return the reversed path."""
        return LanePath([segment.reversed() for segment in self.segments[::-1]])

    def _number(self, s):
        return min(max(bisect.bisect_right(self._begins, s) - 1, 0), len(self.segments) - 1)


def lane_offsets(width: float, lane_width: float) -> list[float]:
    """Return the distances of lanes, or of the middles of cells, from one side of a strip, m.

    They are equally spaced, at most ``lane_width`` apart, and as few as possible.
    """
    count = max(1, math.ceil(width / lane_width - _SLACK))
    spacing = width / count
    return [(k + 0.5) * spacing for k in range(count)]


def sweep(area: Area, lane_width: float, height: float) -> LanePath:
    """Return the path that sweeps an area: along x, an arc, back along x, and so on.

    Lanes are at most ``lane_width`` (m) apart. The arcs are outside the area: they extend beyond
    its ends by half the distance of two lanes.
    """
    ys = [area.y_min + offset for offset in lane_offsets(area.y_max - area.y_min, lane_width)]
    segments: list[Segment] = []
    for number, y in enumerate(ys):
        is_forward = number % 2 == 0
        begin, end = (area.x_min, area.x_max) if is_forward else (area.x_max, area.x_min)
        segments.append(Line((begin, y, height), (end, y, height)))
        if number + 1 < len(ys):
            radius = (ys[number + 1] - y) / 2.0
            turn = math.pi if is_forward else -math.pi
            segments.append(Arc((end, y + radius, height), radius, -math.pi / 2.0, turn))
    return LanePath(segments)
