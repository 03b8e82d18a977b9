"""A sweep: its reference, its coverage of the area, its tracking error."""

import math

import numpy as np
from numpy.typing import NDArray

from crazyflie_sweep.lanes import LanePath, Line, Point, lane_offsets, sweep
from crazyflie_sweep.sweep_parameters import Area, SweepPlan
from crazyflie_sweep.velocities import OSCILLATOR_BEGIN, OSCILLATOR_END, OSCILLATOR_LENGTH


class Coverage:
    """Cells of an area over which a sensor has passed; it sees a disc of diameter ``swath`` (m).

    ``cell`` is the largest width of a cell, m.
    """

    def __init__(self, area: Area, cell: float, swath: float):
        width, height = area.x_max - area.x_min, area.y_max - area.y_min
        xs, ys = lane_offsets(width, cell), lane_offsets(height, cell)
        #: Width of the cells along x and y, m.
        self.cell_size = (width / len(xs), height / len(ys))
        self._radius = swath / 2.0
        x, y = np.meshgrid(xs, ys, indexing="ij")
        self._x, self._y = area.x_min + x, area.y_min + y
        self._is_covered = np.zeros(self._x.shape, dtype=bool)

    def add(self, position: Point) -> bool:
        """Cover the cells whose middle is in the disc around a position; return whether any is new.

        Single positions suffice if they are much closer together than the disc's diameter.
        """
        x, y, _ = position
        is_near = (self._x - x) ** 2 + (self._y - y) ** 2 <= self._radius**2
        is_new = is_near & ~self._is_covered
        self._is_covered |= is_near
        return bool(is_new.any())

    @property
    def share(self) -> float:
        """Fraction of covered cells, 0 to 1."""
        return float(self._is_covered.mean())

    def middles(self, covered: bool) -> NDArray[np.float64]:
        """Return the middles of the cells that are (not) covered, m, shape (n, 2)."""
        chosen = self._is_covered == covered
        return np.column_stack((self._x[chosen], self._y[chosen]))


_NEAR = 0.01  #: Distance from the first lane at which a vehicle has arrived (m).


class Sweeper:
    """Moves a reference along lanes and arcs, and measures the vehicle that follows it.

    Velocities on lanes come from a service for the interval [2, 9] only, so lanes are scaled to it:
    positions and velocities by the same factor. ``start`` is the position of the vehicle.
    """

    def __init__(self, plan: SweepPlan, start: Point):
        self._plan = plan
        #: Path through the area, without the path to its begin.
        self.lanes = sweep(plan.area, plan.lane_width, plan.height)
        self._scale = (plan.area.x_max - plan.area.x_min) / OSCILLATOR_LENGTH
        self.coverage = Coverage(plan.area, plan.coverage.cell, plan.coverage.swath)
        #: Largest distance of the vehicle from its lane (m).
        self.max_lane_distance = 0.0
        self.speed = 0.0  #: Speed of the reference (m/s).
        self._passes = 1
        self._s = 0.0
        self._path = self._with_approach(start)
        #: Whether the reference is at rest at the end: the area is covered, or cannot be covered.
        self.is_done = False

    @property
    def is_covered(self) -> bool:
        """Whether the goal has been reached."""
        return self.coverage.share >= self._plan.coverage.goal

    @property
    def lane(self) -> Line | None:
        """The lane on which the reference is, where a service sets its speed; None elsewhere."""
        segment = self._path.segment_at(self._s)
        return segment if isinstance(segment, Line) and segment.is_lane else None

    def service_position(self, x: float) -> float:
        """Return the position ``x`` (m) scaled to the service's interval."""
        scaled = OSCILLATOR_BEGIN + (x - self._plan.area.x_min) / self._scale
        return min(max(scaled, OSCILLATOR_BEGIN), OSCILLATOR_END)

    def advance(self, dt: float, velocity: float | None) -> None:
        """Move the reference for ``dt`` seconds.

        ``velocity`` is the service's, in its units, and is used on lanes; None stops the reference
        everywhere.
        """
        limits = self._plan.speed
        if velocity is None:
            target = 0.0
        elif self.lane is not None:
            target = min(max(velocity * self._scale, limits.min), limits.max)
        else:
            target = limits.turn
        change = limits.acceleration * dt
        # The reference comes to rest at the end instead of stopping abruptly.
        left = max(self._path.length - self._s, 0.0)
        target = min(target, max(math.sqrt(2.0 * limits.acceleration * left), change))
        self.speed += min(max(target - self.speed, -change), change)
        self._s += self.speed * dt
        if self._s >= self._path.length:
            self._end_pass()

    def _end_pass(self):
        self._s = self._path.length
        self.speed = 0.0
        if self.is_covered or self._passes >= self._plan.coverage.max_passes:
            self.is_done = True
            return
        self._passes += 1
        self._path = self.lanes = self.lanes.reversed()
        self._s = 0.0

    @property
    def reference(self) -> tuple[float, float, float, float, float, float]:
        """Point (m) and velocity (m/s) of the reference: x, y, z, x_dot, y_dot, z_dot."""
        position, (ux, uy, uz) = self._path.at(self._s)
        return *position, self.speed * ux, self.speed * uy, self.speed * uz

    def measure(self, position: Point) -> bool:
        """Process a position of the vehicle; return whether it has covered new cells."""
        if (lane := self.lane) is not None:
            self.max_lane_distance = max(self.max_lane_distance, lane.distance(position))
        return self.coverage.add(position)

    def _with_approach(self, start):
        begin, _ = self.lanes.at(0.0)
        if math.dist(start, begin) < _NEAR:
            return self.lanes
        return LanePath([Line(start, begin, is_lane=False), *self.lanes.segments])
