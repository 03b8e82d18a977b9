"""A sweep as it is flown: where the reference goes, and what has come of it."""

import math
from dataclasses import dataclass

from crazyflie_sweep.coverage import Coverage
from crazyflie_sweep.lanes import Area, Line, Point, Way, back, sweep
from crazyflie_sweep.velocities import OSCILLATOR_BEGIN, OSCILLATOR_END, OSCILLATOR_LENGTH

_NEAR = 0.01
"""A vehicle that is nearer to the first lane, m, is there."""


@dataclass(frozen=True)
class Plan:
    """What to sweep, and how.

    Attributes
    ----------
    area : Area
    lane_width : float
        The largest distance of two lanes, m.
    height : float
        m.
    min_speed, max_speed : float
        On lanes, m/s.
    turn_speed : float
        On arcs and on the way to the first lane, m/s.
    acceleration : float
        The largest one along the way, m/s^2.
    swath : float
        Diameter of what is covered at a time, m.
    cell : float
        Width of the cells in which coverage is counted, m.
    goal : float
        The share that has to be covered, 0 to 1.
    max_passes : int
        How often the area is swept, there and back, to reach the goal.
    """

    area: Area
    lane_width: float
    height: float
    min_speed: float
    max_speed: float
    turn_speed: float
    acceleration: float
    swath: float
    cell: float
    goal: float
    max_passes: int


class Sweeper:
    """Moves a reference along lanes and arcs, and measures the vehicle that follows it.

    Velocities on lanes come from a service that knows the interval [2, 9] only, so that
    lanes are scaled to it: positions and velocities by the same factor.

    Parameters
    ----------
    plan : Plan
    start : Point
        Where the vehicle is.

    Attributes
    ----------
    coverage : Coverage
    max_lane_distance : float
        The largest distance of the vehicle from the lane that it was on, m.
    speed : float
        Of the reference, m/s.
    """

    def __init__(self, plan: Plan, start: Point):
        self._plan = plan
        self._lanes = sweep(plan.area, plan.lane_width, plan.height)
        self._scale = (plan.area.x_max - plan.area.x_min) / OSCILLATOR_LENGTH
        self.coverage = Coverage(plan.area, plan.cell, plan.swath)
        self.max_lane_distance = 0.0
        self.speed = 0.0
        self._passes = 1
        self._s = 0.0
        self._way = self._with_approach(start)
        self._is_done = False

    @property
    def lanes(self) -> Way:
        """The way through the area, without the one to its begin."""
        return self._lanes

    @property
    def is_done(self) -> bool:
        """Whether the reference is at rest at the end: the area is covered, or cannot be."""
        return self._is_done

    @property
    def is_covered(self) -> bool:
        """Whether the goal has been reached."""
        return self.coverage.share >= self._plan.goal

    @property
    def is_on_lane(self) -> bool:
        """Whether the reference is on a lane: there a service says how fast it goes."""
        segment = self._way.segment_at(self._s)
        return isinstance(segment, Line) and segment.is_lane

    def service_position(self, x: float) -> float:
        """Return what stands for the position ``x`` (m) in the service's interval."""
        scaled = OSCILLATOR_BEGIN + (x - self._plan.area.x_min) / self._scale
        return min(max(scaled, OSCILLATOR_BEGIN), OSCILLATOR_END)

    def advance(self, dt: float, velocity: float | None) -> None:
        """Let the reference go on for ``dt`` seconds.

        Parameters
        ----------
        dt : float
            s.
        velocity : float or None
            What the service says, in its units; None for: hover. Without effect off the
            lanes, but for None on the way from one to the next, which stops the reference.
        """
        plan = self._plan
        if velocity is None:
            target = 0.0
        elif self.is_on_lane:
            target = min(max(velocity * self._scale, plan.min_speed), plan.max_speed)
        else:
            target = plan.turn_speed
        change = plan.acceleration * dt
        # So that the reference comes to rest at the end and does not stop dead there.
        left = max(self._way.length - self._s, 0.0)
        target = min(target, max(math.sqrt(2.0 * plan.acceleration * left), change))
        self.speed += min(max(target - self.speed, -change), change)
        self._s += self.speed * dt
        if self._s >= self._way.length:
            self._end_pass()

    def _end_pass(self):
        self._s = self._way.length
        self.speed = 0.0
        if self.is_covered or self._passes >= self._plan.max_passes:
            self._is_done = True
            return
        self._passes += 1
        self._lanes = back(self._lanes)
        self._way = self._lanes
        self._s = 0.0

    @property
    def reference(self) -> tuple[float, float, float, float, float, float]:
        """Point (m) and velocity (m/s) of the reference: x, y, z, x_dot, y_dot, z_dot."""
        position, (ux, uy, uz) = self._way.at(self._s)
        return *position, self.speed * ux, self.speed * uy, self.speed * uz

    def measure(self, position: Point) -> bool:
        """Take note of where the vehicle is; return whether it has covered something new."""
        segment = self._way.segment_at(self._s)
        if isinstance(segment, Line) and segment.is_lane:
            self.max_lane_distance = max(self.max_lane_distance, segment.distance(position))
        return self.coverage.add(position)

    def _with_approach(self, start):
        begin, _ = self._lanes.at(0.0)
        if math.dist(start, begin) < _NEAR:
            return self._lanes
        return Way([Line(start, begin, is_lane=False), *self._lanes.segments])
