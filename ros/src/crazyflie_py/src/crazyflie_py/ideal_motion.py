"""Motion of an ideal vehicle: it is where its plan, or its setpoint, says."""

import math
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from crazyflie_model.angles import Triple
from crazyflie_model.collision_avoidance import AvoidanceSettings, CollisionAvoidance
from crazyflie_model.polynomials import Goal
from crazyflie_model.units import GRAVITY
from crazyflie_py.setpoints import FullState, Hover, Position, Setpoint, VelocityWorld

Array = NDArray[np.float64]


class Motion(NamedTuple):
    """Position (m), velocity (m/s), acceleration (m/s^2), each (3,), and yaw (rad)."""

    position: Array
    velocity: Array
    acceleration: Array
    yaw: float


class IdealMotion:
    """Motion of one vehicle, in steps.

    Parameters
    ----------
    position : tuple, 3 components
        At the beginning, m; the yaw is 0.
    max_speed : float
        m/s.
    disturbance : float
        Standard deviation of what is added to the velocity of velocity setpoints, m/s.
    """

    def __init__(self, position: Triple, max_speed: float, disturbance: float):
        self._max_speed = max_speed
        self._disturbance = disturbance
        self._avoidance: CollisionAvoidance | None = None
        self._others: Sequence[IdealMotion] = ()
        self.now = Motion(np.array(position), np.zeros(3), np.zeros(3), 0.0)

    def avoid(self, others: Sequence[Self], settings: AvoidanceSettings | None) -> None:
        """Avoid others from now on; with None for settings, no more."""
        self._others = others
        self._avoidance = None if settings is None else CollisionAvoidance(settings)

    def held(self) -> Motion:
        """Return the motion of staying in place."""
        return Motion(self.now.position, np.zeros(3), np.zeros(3), self.now.yaw)

    def tracked(self, goal: Goal[float] | FullState, dt: float) -> Motion:
        """Return the motion ``dt`` (s) from now, as far as avoidance and speed permit the goal."""
        vectors = (goal.position, goal.velocity, goal.acceleration)
        position, velocity, acceleration = map(np.array, vectors)
        return self._limited(Motion(position, velocity, acceleration, goal.yaw), dt)

    def at_setpoint(self, setpoint: Setpoint, dt: float) -> Motion:
        """Return the motion ``dt`` (s) from now; an attitude keeps the vehicle in place."""
        if isinstance(setpoint, FullState):
            return self.tracked(setpoint, dt)
        if isinstance(setpoint, Position):
            zero = np.zeros(3)
            goal = Motion(np.array(setpoint.position), zero, zero, setpoint.yaw)
            return self._approached(self._limited(goal, dt), dt)
        if isinstance(setpoint, VelocityWorld):
            return self._at_velocity(np.array(setpoint.velocity), setpoint.yaw_rate, dt)
        if isinstance(setpoint, Hover):
            climb = (setpoint.height - self.now.position[2]) / dt
            velocity = np.array([*setpoint.velocity(self.now.yaw), climb])
            return self._at_velocity(velocity, setpoint.yaw_rate, dt)
        return self.held()

    def _limited(self, goal, dt):
        if self._avoidance is not None:
            position, velocity = self._avoidance.position_setpoint(
                self.now.position, self._other_positions(), goal.position, goal.velocity
            )
            if np.array_equal(position, goal.position):
                goal = goal._replace(velocity=velocity)
            else:
                goal = self._approached(goal._replace(position=position), dt)
        way = goal.position - self.now.position
        reach = self._max_speed * dt
        if np.linalg.norm(way) <= reach:
            return goal
        return self._approached(
            goal._replace(position=self.now.position + _clamped(way, reach)), dt
        )

    def _approached(self, goal, dt):
        """Return a goal with the velocity at which it is reached."""
        velocity = (goal.position - self.now.position) / dt
        return goal._replace(velocity=velocity, acceleration=np.zeros(3))

    def _at_velocity(self, velocity, yaw_rate, dt):
        position = self.now.position
        if self._avoidance is not None:
            others = self._other_positions()
            velocity = self._avoidance.velocity_setpoint(position, others, velocity)
        velocity = _clamped(velocity, self._max_speed)
        if self._disturbance:
            velocity = velocity + self._disturbance * np.random.normal(size=3)
        yaw = self.now.yaw + math.radians(yaw_rate) * dt
        return Motion(position + dt * velocity, velocity, np.zeros(3), yaw)

    def _other_positions(self):
        return np.array([other.now.position for other in self._others]).reshape(-1, 3)


def attitude(acceleration: Array, yaw: float) -> Triple:
    """Return roll, pitch and yaw (rad) of a multirotor that accelerates, by differential flatness.

    Its thrust is along its z axis, its x axis above the heading. Acceleration of shape (3,), m/s^2.
    """
    ax, ay, az = acceleration
    c, s = math.cos(yaw), math.sin(yaw)
    ahead, left, up = c * ax + s * ay, c * ay - s * ax, az + GRAVITY
    pitch = math.atan2(ahead, up)
    return math.atan2(-left, math.hypot(ahead, up)), pitch, yaw


def _clamped(vector, limit):
    length = float(np.linalg.norm(vector))
    return vector * (limit / length) if length > limit else vector
