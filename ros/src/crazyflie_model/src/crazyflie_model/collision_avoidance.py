"""Collision avoidance by buffered Voronoi cells, as the firmware's collision_avoidance.c.

Zhou, Wang, Bandyopadhyay and Schwager, Fast, On-line Collision Avoidance for Dynamic Vehicles
using Buffered Voronoi Cells (IEEE RA-L 2(2), 2017).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from crazyflie_model.angles import Triple

Array = NDArray[np.float64]

#: Distance of a vehicle from the wall of its cell (m), so that two do not overlap by rounding.
_CLEARANCE = 1e-6


@dataclass(frozen=True)
class AvoidanceSettings:
    """Settings; names of the firmware's parameter group colAv in brackets."""

    radii: Triple  #: Radii of the ellipsoid that others stay out of, m (ellipsoidX, Y, Z).
    #: box_min, box_max: Corners of the box that the vehicle stays in, m (bboxMinX, ... bboxMaxZ).
    box_min: Triple = (-math.inf,) * 3
    box_max: Triple = (math.inf,) * 3
    horizon: float = 1.0  #: Time over which motion is limited, s (horizon).
    max_speed: float = 0.5  #: Largest speed of each axis, m/s (maxSpeed).
    #: Distance from a wall of the cell at which a sidestep to the right begins, m (sidestepThrsh).
    sidestep_threshold: float = 0.25
    #: Largest distance outside of the cell of a point that is inside, in tenths of m (vorTol).
    tolerance: float = 1e-5
    max_iterations: int = 100  #: Largest number of iterations of the projection (vorIters).


class CollisionAvoidance:
    """Modifies the setpoints of one vehicle."""

    def __init__(self, settings: AvoidanceSettings):
        self.settings = settings
        self._last_feasible: Array | None = None

    def position_setpoint(
        self, position: Array, others: Array, goal: Array, velocity: Array
    ) -> tuple[Array, Array]:
        """Return the position (m) and velocity (m/s) to track instead of a goal and its velocity.

        A velocity of 0 means a goal to stop at. ``others`` are the positions of n other vehicles,
        shape (n, 3), m.
        """
        cell = _Cell(self.settings, position, others)
        wanted = goal - position
        feasible = cell.sidestep(wanted, is_velocity=False)
        if feasible is None or not cell.contains(feasible):
            stay = position if self._last_feasible is None else self._last_feasible
            self._last_feasible = stay
            return stay, np.zeros(3)
        if feasible is wanted:
            scale = min(cell.ray(wanted, velocity), 1.0)
            position, velocity = goal, scale * velocity
        else:
            position, velocity = cell.clip(position + feasible), np.zeros(3)
        self._last_feasible = position
        return position, velocity

    def velocity_setpoint(self, position: Array, others: Array, velocity: Array) -> Array:
        """Return the velocity (m/s) to fly instead of one; see `position_setpoint`."""
        cell = _Cell(self.settings, position, others)
        horizon = self.settings.horizon
        self._last_feasible = position
        if cell.contains(np.zeros(3)):
            step = cell.sidestep(horizon * velocity, is_velocity=True)
            return np.zeros(3) if step is None else step / horizon
        step = cell.project(np.zeros(3))
        if step is None:
            return np.zeros(3)
        speed = float(np.linalg.norm(step))
        return step * min(1.0, self.settings.max_speed / speed) if speed > 0.0 else step


class _Cell:
    """The buffered Voronoi cell, relative to the vehicle: points x with ``normals @ x <= limits``.

    Distances are those of a space that is scaled by the radii, where the ellipsoid is a sphere.
    """

    def __init__(self, settings: AvoidanceSettings, position: Array, others: Array):
        self._settings = settings
        radii = np.array(settings.radii)
        to_others = (others - position) / radii
        distances = np.linalg.norm(to_others, axis=1)
        # For a vehicle at the same place, the direction is not defined.
        apart = distances > 0.0
        to_others, distances = to_others[apart], distances[apart]
        faces = to_others / radii / distances[:, None]
        scales = np.linalg.norm(faces, axis=1)
        reach = settings.horizon * settings.max_speed
        self._box = np.array(settings.box_min), np.array(settings.box_max)
        self._low = np.maximum(-reach, self._box[0] - position)
        self._high = np.minimum(reach, self._box[1] - position)
        limits = (distances / 2.0 - 1.0) / scales - _CLEARANCE
        self._normals = np.vstack([faces / scales[:, None], np.eye(3), -np.eye(3)])
        self._limits = np.concatenate([limits, self._high, -self._low])

    def contains(self, point):
        """Return whether a point is inside, with the firmware's tolerance."""
        limits = self._limits + 10.0 * self._settings.tolerance
        return bool(np.all(self._normals @ point <= limits))

    def clip(self, position):
        """Return a position within the box, without the rounding of differences."""
        return np.clip(position, *self._box)

    def ray(self, origin, direction):
        """Return the distance from a point inside to the wall, in lengths of a direction."""
        rates = self._normals @ direction
        ahead = rates > 0.0
        room = self._limits[ahead] - self._normals[ahead] @ origin
        with np.errstate(over="ignore"):
            return float(np.min(room / rates[ahead], initial=math.inf))

    def sidestep(self, goal, is_velocity):
        """Return the goal, moved to the right before a wall, in the cell; None if it is empty.

        A position in the cell is returned as the same object.
        """
        scale = self.ray(np.zeros(3), goal)
        if scale >= 1.0 and not is_velocity:
            return goal
        length = float(np.linalg.norm(goal))
        # Without a velocity, there is no direction to a wall.
        distance = scale * length if length > 0.0 else math.inf
        threshold = self._settings.sidestep_threshold
        if distance <= threshold and threshold > 0.0:
            amount = (1.0 - distance / threshold) ** 2
            goal = goal + amount * np.array([goal[1], -goal[0], 0.0])
        return self.project(goal)

    def project(self, point):
        """Return the nearest point of the cell, or None if the cell is empty.

        Least distance programming by non-negative least squares: Lawson and Hanson, Solving Least
        Squares Problems, chapter 23.
        """
        excess = self._normals @ point - self._limits
        if np.all(excess <= 0.0):
            return point
        bounded = np.isfinite(excess)
        normals, excess = -self._normals[bounded], excess[bounded]
        target = np.array([0.0, 0.0, 0.0, 1.0])
        try:
            weights, _ = nnls(
                np.vstack([normals.T, excess]), target, maxiter=self._settings.max_iterations
            )
        except RuntimeError:
            return None
        residual = np.vstack([normals.T, excess]) @ weights - target
        if abs(residual[3]) < 1e-12:
            return None
        point = np.clip(point - residual[:3] / residual[3], self._low, self._high)
        return point if self.contains(point) else None
