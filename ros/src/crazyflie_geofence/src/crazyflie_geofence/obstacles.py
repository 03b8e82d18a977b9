"""Planes in front of obstacles: a vehicle that stays beyond one does not touch the obstacle.

An obstacle is convex. The plane of each face separates it from all vehicles outside of the face; a
round one has a plane for each direction. Those count that face the vehicle, and where it passes.
The proof (docs/geofence_proof.md) is that of a wall, for each plane.
"""

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

from crazyflie_world.shapes import Ball, Box, Cylinder, Shape

Triple = tuple[float, float, float]

#: How much further than beside each other vehicles are kept above each other.
DOWNWASH = 2.0


class Plane(NamedTuple):
    """The vehicle stays where normal . position >= offset."""

    normal: Triple  #: Of length 1, away from the obstacle: horizontal, or along z.
    offset: float  #: m

    def distance(self, position: Triple) -> float:
        """Return how far a position is in front of the plane (m)."""
        return self.along(position) - self.offset

    def along(self, vector: Triple) -> float:
        """Return the component of a vector along the normal."""
        (a, b, c), (x, y, z) = self.normal, vector
        return a * x + b * y + c * z


def planes(shape: Shape, position: Triple, velocity: Triple, clearance: float) -> list[Plane]:
    """Return the planes that may separate a vehicle from an obstacle, with a clearance (m).

    Position (m) and velocity (m/s) are those of the vehicle.
    """
    x, y, z = shape.centre
    half_x, half_y, half_z = (length / 2.0 + clearance for length in shape.size)
    found = [Plane((0.0, 0.0, 1.0), z + half_z), Plane((0.0, 0.0, -1.0), half_z - z)]
    if isinstance(shape, Box):
        c, s = math.cos(shape.yaw), math.sin(shape.yaw)
        for (a, b), half in (((c, s), half_x), ((-s, c), half_y)):
            middle = a * x + b * y
            found += [Plane((a, b, 0.0), middle + half), Plane((-a, -b, 0.0), half - middle)]
    elif isinstance(shape, Cylinder | Ball):
        # A ball is taken for the cylinder around it.
        ahead, left, vx, vy = position[0] - x, position[1] - y, velocity[0], velocity[1]
        # Until it is nearest, if it flies straight on.
        passing = max(-(ahead * vx + left * vy), 0.0) / max(vx * vx + vy * vy, 1e-9)
        # The planes that face it now, and there.
        for time in (0.0, passing):
            to_x, to_y = ahead + time * vx, left + time * vy
            distance = math.hypot(to_x, to_y)
            a, b = (to_x / distance, to_y / distance) if distance > 0.0 else (1.0, 0.0)
            found.append(Plane((a, b, 0.0), a * x + b * y + half_x))
    return found


def halfway(position: Triple, other: Triple, buffer: float) -> Plane:
    """Return the plane behind which a vehicle has half of the room to another, less a buffer (m).

    Beside each other, or above each other with `DOWNWASH` times the buffer: where there is more
    room. The other vehicle finds the same plane, seen from the other side.
    """
    ahead, left, above = (a - b for a, b in zip(position, other, strict=True))
    distance = math.hypot(ahead, left)
    if abs(above) / DOWNWASH > distance or distance == 0.0:
        normal, buffer = (0.0, 0.0, math.copysign(1.0, above)), DOWNWASH * buffer
    else:
        normal = ahead / distance, left / distance, 0.0
    middle = sum(n * (a + b) / 2.0 for n, a, b in zip(normal, position, other, strict=True))
    return Plane(normal, middle + buffer)


class Obstacles:
    """Chooses a plane for each obstacle, and another only where the vehicle has more room."""

    def __init__(self, shapes: Iterable[Shape], clearance: float):
        self._shapes, self._clearance = tuple(shapes), clearance
        self._chosen: list[Plane | None] = [None] * len(self._shapes)

    def choose(
        self,
        position: Triple,
        velocity: Triple,
        is_far: Callable[[Plane], bool],
        room: Callable[[Plane], float],
    ) -> list[Plane]:
        """Return a plane for each obstacle; the present one while it is far.

        ``room(plane)`` is the distance between the vehicle's stopping point and a plane (m):
        where it is positive, the vehicle can stay in front of the plane.
        """
        for i, present in enumerate(self._chosen):
            if present is None or not is_far(present):
                best = max(planes(self._shapes[i], position, velocity, self._clearance), key=room)
                if present is None or room(best) > room(present):
                    self._chosen[i] = best
        return [plane for plane in self._chosen if plane is not None]
