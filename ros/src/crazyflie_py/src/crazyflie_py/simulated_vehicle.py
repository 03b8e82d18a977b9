"""One vehicle of --sim."""

import logging
import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from crazyflie_mission_api.dry_run import IdealVehicle
from crazyflie_mission_api.mission_vehicle import (
    AttitudeSetpoint,
    FullStateSetpoint,
    HoverSetpoint,
    MotorsOffSetpoint,
    PositionSetpoint,
    Setpoint,
    VelocityWorldSetpoint,
    done,
)
from crazyflie_model.angles import Triple, rotate_by_yaw
from crazyflie_model.collision_avoidance import AvoidanceSettings, CollisionAvoidance
from crazyflie_model.limits import LEVEL_AGE
from crazyflie_model.polynomials import Goal
from crazyflie_model.units import GRAVITY
from crazyflie_py.fleet import FleetVehicle
from crazyflie_py.simulated_parameters import SimulatedParameters
from crazyflie_py.swarm import STATUS_FIELDS, ScriptState
from crazyflie_py.util import clamp_norm

Array = NDArray[np.float64]

_log = logging.getLogger(__name__)

#: Height above the start from which motors are not stopped without a warning, m.
_FALL_HEIGHT = 0.1


class SimulatedMotion(NamedTuple):
    """Position (m), velocity (m/s), acceleration (m/s^2), each (3,), and yaw (rad)."""

    position: Array
    velocity: Array
    acceleration: Array
    yaw: float


def attitude(acceleration: Array, yaw: float) -> Triple:
    """Return roll, pitch and yaw (rad) of a multirotor that accelerates, by differential flatness.

    Its thrust is along its z axis, its x axis above the heading. Acceleration of shape (3,), m/s^2.
    """
    ax, ay, az = acceleration
    (ahead, left), up = rotate_by_yaw(ax, ay, -yaw), az + GRAVITY
    pitch = math.atan2(ahead, up)
    return math.atan2(-left, math.hypot(ahead, up)), pitch, yaw


class SimulatedVehicle(IdealVehicle):
    """The ideal vehicle of missions, which moves in steps.

    It follows its plan, or the last setpoint, as far as speed and avoidance permit. A warning is
    logged once where a real vehicle would do less.

    Parameters
    ----------
    vehicle : FleetVehicle
    time : callable
        Returns the time of the simulation, s.
    max_speed, disturbance : float
        Options --maxvel and --disturbance, m/s.
    said : set of str
        See `SimulatedParameters`.
    """

    def __init__(
        self,
        vehicle: FleetVehicle,
        time: Callable[[], float],
        max_speed: float,
        disturbance: float,
        said: set[str],
    ):
        self._warned: set[str] = set()
        super().__init__(vehicle.name, time, vehicle.position)
        self.config = vehicle
        self.parameters = SimulatedParameters(self, said)
        #: Position and motion, which the swarm sets in steps.
        self.motion = SimulatedMotion(np.array(vehicle.position), np.zeros(3), np.zeros(3), 0.0)
        self._max_speed = max_speed
        self._disturbance = disturbance
        self._avoidance: CollisionAvoidance | None = None
        self._others: Sequence[Self] = ()
        self._setpoint: Setpoint | None = None
        self._sent = 0.0
        self._expiry = math.inf
        self._locked = False

    # Commands.

    @override
    def _may_plan(self, method: str, group_mask: int) -> bool:
        if self._locked or not super()._may_plan(method, group_mask):
            return False
        if self._setpoint is not None and math.isinf(self._expiry):
            self._warn(
                f"{self.name}.{method}: setpoints were not ended by notifySetpointsStop; "
                "a real vehicle ignores the command"
            )
        self._setpoint = None
        return True

    @override
    def planned(self) -> Goal[float]:
        if self.is_active:
            return super().planned()
        *vectors, yaw = self.motion
        position, velocity, _ = (vector.tolist() for vector in vectors)
        return Goal(tuple(position), tuple(velocity), (0.0, 0.0, 0.0), yaw, 0.0)

    @override
    def notify_setpoints_stop(self, remain_valid_ms: int, group_mask: int = 0) -> "Future[Any]":
        self._expiry = self._time() + remain_valid_ms / 1000.0
        return done(None)

    @override
    def emergency(self) -> "Future[Any]":
        self._warn(f"{self.name}.emergency: the vehicle ignores all further commands")
        self._stop_motors("emergency")
        self._locked = True
        return done(None)

    @override
    def send(self, setpoint: Setpoint) -> None:
        if self._locked:
            return
        super().send(setpoint)
        self._setpoint, self._expiry, self._sent = setpoint, math.inf, self._time()
        if isinstance(setpoint, MotorsOffSetpoint):
            self._stop_motors("cmdStop")
        if isinstance(setpoint, AttitudeSetpoint):
            self._warn(f"{self.name}.cmdVel: an ideal vehicle has no attitude; it stays in place")

    @override
    def _stop_motors(self, method: str) -> None:
        height = self.motion.position[2] - self.config.position[2]
        if height > _FALL_HEIGHT:
            self._warn(
                f"{self.name}.{method}: the motors stop {height:.2f} m above the start; a real "
                "vehicle falls, this one stays in place"
            )
        super()._stop_motors(method)
        self._setpoint = None

    def avoid(self, others: Sequence[Self], settings: AvoidanceSettings | None) -> None:
        """Avoid other vehicles; None for settings ends collision avoidance."""
        self._others = others
        self._avoidance = None if settings is None else CollisionAvoidance(settings)

    def checked_yaw(self, yaw: float) -> float:
        """Return the yaw, rad: the vehicle can have any."""
        return yaw

    # State.

    @property
    def is_flying(self) -> bool:
        """Whether motors would run."""
        return self._setpoint is not None or self.is_active

    def state(self) -> ScriptState:
        """Return position, velocity, acceleration and attitude."""
        *vectors, yaw = self.motion
        (x, y, z), (vx, vy, vz), (ax, ay, az) = (vector.tolist() for vector in vectors)
        rpy = attitude(self.motion.acceleration, yaw)
        return ScriptState((x, y, z), (vx, vy, vz), (ax, ay, az), rpy)

    def status(self) -> dict[str, Any]:
        """Return the status with the keys of crazyswarm2's Crazyflie.get_status."""
        seconds = math.floor(self._time())
        # Bits as supervisor.info of the firmware has them.
        bits = 0b1001 | self.is_armed << 1 | self.is_flying << 4 | self._locked << 6
        return {
            "id": self.name,
            "timestamp_sec": seconds,
            "timestamp_nsec": int((self._time() - seconds) * 1e9),
            "supervisor": bits,
            "battery": 4.2,
            **dict.fromkeys(STATUS_FIELDS, 0),
        }

    def next_motion(self, dt: float) -> SimulatedMotion:
        """Return the motion at the present time, ``dt`` (s) after `motion`."""
        now = self._time()
        if now > self._expiry:
            self._setpoint = None
        if self._setpoint is not None:
            if math.isinf(self._expiry) and now > self._sent + LEVEL_AGE + dt:
                self._warn(
                    f"{self.name}: no setpoint for {LEVEL_AGE:g} s; a real vehicle levels "
                    "out and stops its motors 2 s after the last one"
                )
            return self._at_setpoint(self._setpoint, dt)
        # Also at the end of a landing.
        if self._flies or now - dt < self.trajectory.end:
            return self._tracked(self.trajectory.goal(now), dt)
        return self._stopped()

    def _stopped(self) -> SimulatedMotion:
        """Return the motion of a vehicle that stays at its place."""
        return SimulatedMotion(self.motion.position, np.zeros(3), np.zeros(3), self.motion.yaw)

    def _tracked(self, goal: Goal[float] | FullStateSetpoint, dt: float) -> SimulatedMotion:
        """Return the motion ``dt`` (s) from now, towards the goal, as far as limits permit."""
        vectors = (goal.position, goal.velocity, goal.acceleration)
        position, velocity, acceleration = map(np.array, vectors)
        return self._limited(SimulatedMotion(position, velocity, acceleration, goal.yaw), dt)

    def _at_setpoint(self, setpoint: Setpoint, dt: float) -> SimulatedMotion:
        """Return the motion ``dt`` (s) from now; an attitude keeps the vehicle in place."""
        if isinstance(setpoint, FullStateSetpoint):
            return self._tracked(setpoint, dt)
        if isinstance(setpoint, PositionSetpoint):
            zero = np.zeros(3)
            goal = SimulatedMotion(np.array(setpoint.position), zero, zero, setpoint.yaw)
            return self._approached(self._limited(goal, dt), dt)
        if isinstance(setpoint, VelocityWorldSetpoint):
            return self._at_velocity(np.array(setpoint.velocity), setpoint.yaw_rate, dt)
        if isinstance(setpoint, HoverSetpoint):
            climb = (setpoint.height - self.motion.position[2]) / dt
            horizontal = rotate_by_yaw(setpoint.vx, setpoint.vy, self.motion.yaw)
            velocity = np.array([*horizontal, climb])
            return self._at_velocity(velocity, setpoint.yaw_rate, dt)
        return self._stopped()

    def _limited(self, goal, dt):
        if self._avoidance is not None:
            position, velocity = self._avoidance.position_setpoint(
                self.motion.position, self._other_positions(), goal.position, goal.velocity
            )
            if np.array_equal(position, goal.position):
                goal = goal._replace(velocity=velocity)
            else:
                goal = self._approached(goal._replace(position=position), dt)
        way = goal.position - self.motion.position
        reach = self._max_speed * dt
        if np.linalg.norm(way) <= reach:
            return goal
        return self._approached(
            goal._replace(position=self.motion.position + clamp_norm(way, reach)), dt
        )

    def _approached(self, goal, dt):
        """Return a goal with the velocity at which it is reached."""
        velocity = (goal.position - self.motion.position) / dt
        return goal._replace(velocity=velocity, acceleration=np.zeros(3))

    def _at_velocity(self, velocity, yaw_rate, dt):
        position = self.motion.position
        if self._avoidance is not None:
            others = self._other_positions()
            velocity = self._avoidance.velocity_setpoint(position, others, velocity)
        velocity = clamp_norm(velocity, self._max_speed)
        if self._disturbance:
            velocity = velocity + self._disturbance * np.random.normal(size=3)
        yaw = self.motion.yaw + math.radians(yaw_rate) * dt
        return SimulatedMotion(position + dt * velocity, velocity, np.zeros(3), yaw)

    def _other_positions(self):
        return np.array([other.motion.position for other in self._others]).reshape(-1, 3)

    @override
    def _warn(self, text: str) -> None:
        # A loop must not flood the terminal.
        if text not in self._warned:
            self._warned.add(text)
            _log.warning(text)
