"""One vehicle of --sim."""

import logging
import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any, Self

import numpy as np
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
from crazyflie_model.polynomials import Goal, at_rest
from crazyflie_model.units import GRAVITY
from crazyflie_py.fleet import FleetVehicle
from crazyflie_py.simulated_parameters import SimulatedParameters
from crazyflie_py.swarm import STATUS_FIELDS, ScriptState
from crazyflie_py.util import clamp_norm

_log = logging.getLogger(__name__)

#: Height above the start from which motors are not stopped without a warning, m.
_FALL_HEIGHT = 0.1


_STILL: Triple = (0.0, 0.0, 0.0)


def _triple(vector):
    x, y, z = map(float, vector)
    return x, y, z


def attitude(acceleration: Triple, yaw: float) -> Triple:
    """Return roll, pitch and yaw (rad) of a multirotor that accelerates, by differential flatness.

    Its thrust is along its z axis, its x axis above the heading. The acceleration is in m/s^2.
    """
    ax, ay, az = acceleration
    (ahead, left), up = rotate_by_yaw(ax, ay, -yaw), az + GRAVITY
    pitch = math.atan2(ahead, up)
    return math.atan2(-left, math.hypot(ahead, up)), pitch, yaw


class SimulatedVehicle(IdealVehicle):
    """The ideal vehicle of missions, which moves in steps.

    It follows its plan, or the last setpoint, as far as speed and avoidance permit. A warning is
    logged once where a real vehicle would do less. ``time()`` returns the time of the simulation,
    s; largest speed and disturbance are the options --maxvel and --disturbance, m/s; for ``said``
    see `SimulatedParameters`.
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
        self.motion = at_rest(vehicle.position)
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
        return self.motion._replace(acceleration=_STILL, yaw_rate=0.0)

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
        position, velocity, acceleration, yaw, _ = self.motion
        return ScriptState(position, velocity, acceleration, attitude(acceleration, yaw))

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

    def next_motion(self, dt: float) -> Goal[float]:
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
            return self._limited(self.trajectory.goal(now), dt)
        return at_rest(self.motion.position, self.motion.yaw)

    def _at_setpoint(self, setpoint: Setpoint, dt: float) -> Goal[float]:
        """Return the motion ``dt`` (s) from now; an attitude keeps the vehicle in place."""
        position, yaw = self.motion.position, self.motion.yaw
        if isinstance(setpoint, FullStateSetpoint):
            vectors = (setpoint.position, setpoint.velocity, setpoint.acceleration)
            return self._limited(Goal(*vectors, setpoint.yaw, 0.0), dt)
        if isinstance(setpoint, PositionSetpoint):
            return self._approached(self._limited(at_rest(*setpoint), dt), dt)
        if isinstance(setpoint, VelocityWorldSetpoint):
            return self._at_velocity(setpoint.velocity, setpoint.yaw_rate, dt)
        if isinstance(setpoint, HoverSetpoint):
            climb = (setpoint.height - position[2]) / dt
            velocity = (*rotate_by_yaw(setpoint.vx, setpoint.vy, yaw), climb)
            return self._at_velocity(velocity, setpoint.yaw_rate, dt)
        return at_rest(position, yaw)

    def _limited(self, goal, dt):
        """Return the motion ``dt`` (s) from now, towards a goal, as far as limits permit."""
        here, position = np.array(self.motion.position), np.array(goal.position)
        if self._avoidance is not None:
            position, velocity = self._avoidance.position_setpoint(
                here, self._other_positions(), position, np.array(goal.velocity)
            )
            goal = goal._replace(velocity=_triple(velocity))
        step, reach = position - here, self._max_speed * dt
        if np.linalg.norm(step) > reach:
            position = here + clamp_norm(step, reach)
        if np.array_equal(position, goal.position):
            return goal
        return self._approached(goal._replace(position=_triple(position)), dt)

    def _approached(self, goal, dt):
        """Return a goal with the velocity at which it is reached."""
        step = np.array(goal.position) - self.motion.position
        return goal._replace(velocity=_triple(step / dt), acceleration=_STILL)

    def _at_velocity(self, velocity, yaw_rate, dt):
        position, velocity = np.array(self.motion.position), np.array(velocity)
        if self._avoidance is not None:
            others = self._other_positions()
            velocity = self._avoidance.velocity_setpoint(position, others, velocity)
        velocity = clamp_norm(velocity, self._max_speed)
        if self._disturbance:
            velocity = velocity + self._disturbance * np.random.normal(size=3)
        yaw = self.motion.yaw + math.radians(yaw_rate) * dt
        return Goal(_triple(position + dt * velocity), _triple(velocity), _STILL, yaw, 0.0)

    def _other_positions(self):
        return np.array([other.motion.position for other in self._others]).reshape(-1, 3)

    @override
    def _warn(self, text: str) -> None:
        # A loop must not flood the terminal.
        if text not in self._warned:
            self._warned.add(text)
            _log.warning(text)
