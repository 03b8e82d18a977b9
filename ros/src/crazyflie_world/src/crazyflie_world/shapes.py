"""Solid shapes in a room, the paths of moving ones, and their intersections with rays.

All shapes are convex, so that a ray is within a shape from one distance to another;
a box, a cylinder and a ball are intersections of simpler ones, such as the space between two
parallel planes (Kay and Kajiya, Ray Tracing Complex Scenes, 1986).
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import override

from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.types import (
    BOOLEAN,
    FINITE,
    METRES,
    POSITION,
    TEXT,
    TIME_STEP,
    ListOf,
    Number,
    matching,
)

Position = tuple[float, float, float]  #: x, y, z in m.
LENGTH = Number("m", above=0.0)
NAME = matching(
    r"[A-Za-z]\w*", "a name of letters, digits and underscores that begins with a letter"
)


class Path(Parameters):
    """The position of an object over time; as declared in a world file."""

    def position(self, time: float) -> Position:
        """Return the position ``time`` seconds after the begin; before that, the first position."""
        raise NotImplementedError


class Circle(Path):
    """A horizontal circle at constant speed."""

    centre: Position = parameter(POSITION, "of the circle")
    radius: float = parameter(LENGTH, "of the circle")
    period: float = parameter(TIME_STEP, "duration of one round")
    phase: float = parameter(Number("rad"), "angle of the begin, from the x axis", 0.0)
    clockwise: bool = parameter(BOOLEAN, "direction, as seen from above", False)

    @override
    def position(self, time: float) -> Position:
        turned = 2.0 * math.pi * max(time, 0.0) / self.period
        angle = self.phase + (-turned if self.clockwise else turned)
        x, y, z = self.centre
        return x + self.radius * math.cos(angle), y + self.radius * math.sin(angle), z


class Waypoints(Path):
    """Straight lines from point to point, each at its time."""

    points: tuple[tuple[float, ...], ...] = parameter(
        ListOf(ListOf(FINITE, 4)), "[time, x, y, z], s and m"
    )
    repeat: bool = parameter(
        BOOLEAN, "begin again after the last point; otherwise stay there", True
    )

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


Colour = tuple[float, float, float]  #: Red, green, blue, each from 0 to 1.
COLOUR = ListOf(Number(minimum=0.0, maximum=1.0), 3)  #: Type of a parameter that is a `Colour`.
Vectors = NDArray[np.float64]  #: Shape (..., 3).
#: Distances at which rays enter and leave, shape (...,); the first is larger for rays that miss the
#: shape.
Interval = tuple[NDArray[np.float64], NDArray[np.float64]]


class Shape(Parameters):
    """Attributes of all solid shapes; as declared in a world file."""

    #: Unique name in a world; that of the tf frame of a moving object.
    name: str = parameter(NAME, "unique name")
    #: x, y, z in the world's frame, m.
    centre: Position = parameter(POSITION, "centre of an object that does not move", None)
    colour: Colour = parameter(COLOUR, "red, green, blue", default=(0.5, 0.5, 0.5))
    path: Path | None = None  #: Path of the centre; None for a fixed shape.

    @property
    def size(self) -> Position:
        """Extent along the object's own x, y and z, m."""
        raise NotImplementedError

    def interval(self, origins: Vectors, directions: Vectors) -> Interval:
        """Return the distances at which rays enter and leave the shape.

        They are in lengths of the directions. Origins (m) and directions, of shape (..., 3), are in
        the world's frame; no direction is 0. Both distances are negative for a shape behind the
        origin.
        """
        raise NotImplementedError

    def moved_to(self, centre: Position) -> Self:
        """Return the same shape at another place."""
        return replace(self, centre=centre)


class Box(Shape):
    """A box that stands upright."""

    extent: Position = parameter(ListOf(LENGTH, 3), "size along its own x, y and z", name="size")
    yaw: float = parameter(Number("rad"), "rotation about the vertical", default=0.0)
    #: Empty for none.
    picture: str = parameter(
        TEXT, "file of a picture on its front, which looks along its own x", default=""
    )

    @property
    def size(self) -> Position:
        """``extent``."""
        return self.extent

    def interval(self, origins: Vectors, directions: Vectors) -> Interval:
        """See `Shape.interval`."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        to_own = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return _between(
            (origins - self.centre) @ to_own, directions @ to_own, np.array(self.extent) / 2.0
        )


class Cylinder(Shape):
    """A cylinder that stands upright; lengths in m."""

    radius: float = parameter(LENGTH, "of the cylinder")
    height: float = parameter(LENGTH, "of the cylinder")

    @property
    def size(self) -> Position:
        """Diameter, diameter, height."""
        return (2.0 * self.radius, 2.0 * self.radius, self.height)

    def interval(self, origins: Vectors, directions: Vectors) -> Interval:
        """See `Shape.interval`."""
        own = origins - self.centre
        return _common(
            _within(own[..., :2], directions[..., :2], self.radius),
            _between(own[..., 2:], directions[..., 2:], np.array([self.height / 2.0])),
        )


class Ball(Shape):
    """A ball; its radius in m."""

    radius: float = parameter(LENGTH, "radius of the ball")

    @property
    def size(self) -> Position:
        """The diameter, three times."""
        return (2.0 * self.radius,) * 3

    def interval(self, origins: Vectors, directions: Vectors) -> Interval:
        """See `Shape.interval`."""
        return _within(origins - self.centre, directions, self.radius)


class Wall(Parameters):
    """A wall that stands on the floor, as declared in a world file."""

    name: str = parameter(NAME, "unique name")
    colour: Colour = parameter(COLOUR, "red, green, blue", default=(0.85, 0.85, 0.8))
    start: tuple[float, float] = parameter(ListOf(METRES, 2), "begin, x and y", name="from")
    end: tuple[float, float] = parameter(ListOf(METRES, 2), "end, x and y", name="to")
    height: float = parameter(LENGTH, "height above the floor", default=2.5)
    thickness: float = parameter(LENGTH, "thickness, half to each side", default=0.1)

    @override
    def complaints(self) -> Iterator[str]:
        if self.start == self.end:
            yield f"from and to are both {list(self.start)}; expected two points (m)"

    def box(self) -> Box:
        """Return the wall as a shape."""
        (x0, y0), (x1, y1) = self.start, self.end
        return Box(
            name=self.name,
            centre=((x0 + x1) / 2.0, (y0 + y1) / 2.0, self.height / 2.0),
            extent=(math.dist(self.start, self.end), self.thickness, self.height),
            yaw=math.atan2(y1 - y0, x1 - x0),
            colour=self.colour,
        )


def cast(
    shapes: tuple[Shape, ...], origins: ArrayLike, directions: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return distance (m) and index of the first object on rays; infinite and -1 without one.

    Origins and directions, of shape (..., 3), are in the world's frame; one origin may serve all.
    Distances are in lengths of the directions. Within a shape the distance is 0.
    """
    origins, directions = np.broadcast_arrays(
        np.asarray(origins, dtype=float), np.asarray(directions, dtype=float)
    )
    distances = np.full(directions.shape[:-1], np.inf)
    indices = np.full(distances.shape, -1)
    for index, shape in enumerate(shapes):
        enter, leave = shape.interval(origins, directions)
        entrance = np.where((enter <= leave) & (leave >= 0.0), np.maximum(enter, 0.0), np.inf)
        indices = np.where(entrance < distances, index, indices)
        distances = np.minimum(distances, entrance)
    return distances, indices


def _between(origins, directions, half):
    # For each axis, the space between two planes; a ray parallel to them is always inside, or
    # never.
    with np.errstate(all="ignore"):
        one, other = (-half - origins) / directions, (half - origins) / directions
    along = directions == 0.0
    outside = along & (np.abs(origins) >= half)
    enter = np.where(along, -np.inf, np.minimum(one, other))
    leave = np.where(along, np.inf, np.maximum(one, other))
    return np.where(outside, np.inf, enter).max(axis=-1), leave.min(axis=-1)


def _within(origins, directions, radius):
    # |o + t d|^2 = r^2, in the plane for a cylinder and in space for a ball.
    a = (directions**2).sum(axis=-1)
    b = (origins * directions).sum(axis=-1)
    c = (origins**2).sum(axis=-1) - radius**2
    along = a == 0.0
    with np.errstate(all="ignore"):
        root = np.sqrt(b**2 - a * c)
        enter, leave = (-b - root) / a, (-b + root) / a
    missed = np.where(along, c > 0.0, np.isnan(root))
    enter = np.where(along, -np.inf, enter)
    return np.where(missed, np.inf, enter), np.where(missed | along, np.inf, leave)


def _common(one, other):
    return np.maximum(one[0], other[0]), np.minimum(one[1], other[1])
