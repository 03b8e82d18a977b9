"""One vehicle of --sim."""

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from crazyflie_mission_api.ideal_vehicle import IdealVehicle
from crazyflie_mission_api.mission_vehicle import MEMORY, done
from crazyflie_model.angles import Triple
from crazyflie_model.collision_avoidance import AvoidanceSettings, CollisionAvoidance
from crazyflie_model.polynomials import Goal, PolynomialPiece
from crazyflie_model.trajectory import Trajectory
from crazyflie_model.units import GRAVITY
from crazyflie_py.backend import VehicleBackend, VehicleState
from crazyflie_py.fleet import FleetVehicle
from crazyflie_py.setpoints import (
    SETPOINT_TIMEOUT,
    Attitude,
    FullState,
    Hover,
    MotorsOff,
    Position,
    Setpoint,
    VelocityWorld,
)
from crazyflie_py.simulated_parameters import SimulatedParameters

Array = NDArray[np.float64]

_DEFINITIONS = 31  #: Trajectories that can be defined at one time.

_log = logging.getLogger(__name__)

#: Height above the start from which motors are not stopped without a warning, m.
_FALL_HEIGHT = 0.1


class SimulatedMotion(NamedTuple):
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
        self.now = SimulatedMotion(np.array(position), np.zeros(3), np.zeros(3), 0.0)

    def avoid(self, others: Sequence[Self], settings: AvoidanceSettings | None) -> None:
        """Avoid others; None for settings ends collision avoidance."""
        self._others = others
        self._avoidance = None if settings is None else CollisionAvoidance(settings)

    def held(self) -> SimulatedMotion:
        """Return the motion of staying in place."""
        return SimulatedMotion(self.now.position, np.zeros(3), np.zeros(3), self.now.yaw)

    def tracked(self, goal: Goal[float] | FullState, dt: float) -> SimulatedMotion:
        """Return the motion ``dt`` (s) from now, as far as avoidance and speed permit the goal."""
        vectors = (goal.position, goal.velocity, goal.acceleration)
        position, velocity, acceleration = map(np.array, vectors)
        return self._limited(SimulatedMotion(position, velocity, acceleration, goal.yaw), dt)

    def at_setpoint(self, setpoint: Setpoint, dt: float) -> SimulatedMotion:
        """Return the motion ``dt`` (s) from now; an attitude keeps the vehicle in place."""
        if isinstance(setpoint, FullState):
            return self.tracked(setpoint, dt)
        if isinstance(setpoint, Position):
            zero = np.zeros(3)
            goal = SimulatedMotion(np.array(setpoint.position), zero, zero, setpoint.yaw)
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
        return SimulatedMotion(position + dt * velocity, velocity, np.zeros(3), yaw)

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


class TrajectoryMemory:
    """The trajectory memory of an ideal vehicle: that of the firmware, with messages.

    Trajectories have the ids of scripts, which go to 255; those of the firmware go to 30.

    Parameters
    ----------
    name : str
        Of the vehicle.
    warn : callable
        Gets a text.
    """

    def __init__(self, name: str, warn: Callable[[str], None]):
        self._name = name
        self._warn = warn
        self._pieces: dict[int, PolynomialPiece] = {}
        self._rooms: dict[int, range] = {}

    def upload(
        self, trajectory_id: int, piece_offset: int, pieces: Sequence[PolynomialPiece]
    ) -> None:
        """Write pieces; ValueError when there is no room."""
        where = f"{self._name}.uploadTrajectory"
        room = range(piece_offset, piece_offset + len(pieces))
        if room.stop > MEMORY:
            raise ValueError(
                f"{where}: {len(pieces)} pieces from pieceOffset {piece_offset} on; expected no "
                f"more than {MEMORY} in all, the room in the memory"
            )
        if trajectory_id not in self._rooms and len(self._rooms) >= _DEFINITIONS:
            raise ValueError(
                f"{where}: trajectoryId is {trajectory_id}; expected one of the {_DEFINITIONS} "
                f"that are in use: {sorted(self._rooms)}"
            )
        if trajectory_id >= _DEFINITIONS:
            self._warn(
                f"{where}: trajectoryId is {trajectory_id}; a real vehicle refuses it, the "
                f"firmware expects 0 to {_DEFINITIONS - 1}"
            )
        for other, taken in self._rooms.items():
            if other != trajectory_id and set(taken) & set(room):
                self._warn(
                    f"{where}: pieces {room.start} to {room.stop - 1} overwrite trajectory "
                    f"{other}; another pieceOffset keeps both"
                )
        self._rooms[trajectory_id] = room
        self._pieces |= dict(zip(room, pieces, strict=True))

    def __getitem__(self, trajectory_id: int) -> list[PolynomialPiece]:
        """Return the pieces of a trajectory; ValueError for one that is not there."""
        if trajectory_id not in self._rooms:
            raise ValueError(
                f"{self._name}.startTrajectory: trajectoryId is {trajectory_id}; expected one that "
                f"uploadTrajectory has written: {sorted(self._rooms) or 'there is none'}"
            )
        return [self._pieces[number] for number in self._rooms[trajectory_id]]


class SimulatedVehicle(IdealVehicle):
    """A vehicle of `crazyflie_py.backend.VehicleBackend`.

    It follows its plan, or the last setpoint, as far as speed and avoidance permit. Where it does
    more than a real one would, a warning says so, once.

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
        super().__init__(vehicle.name, time, vehicle.position)
        self.id, self.initial_position = vehicle.id, vehicle.position
        self.groups = 0  #: Mask of the groups that it belongs to.
        self._motion = IdealMotion(self.initial_position, max_speed, disturbance)
        self._memory = TrajectoryMemory(self.name, self._warn)
        self._parameters = SimulatedParameters(self.name, self, said)
        self._setpoint: Setpoint | None = None
        self._sent = 0.0
        self._expiry = math.inf
        self._locked = False
        self._armed = True
        self._warned: set[str] = set()

    # Commands.

    def _may_plan(self, method: str, group_mask: int) -> bool:
        """Prepare for a high-level command; return whether it concerns this vehicle."""
        if self._locked or (group_mask and not group_mask & self.groups):
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
    def take_off(self, height: float, duration: float, group_mask: int = 0) -> "Future[Any]":
        if self._may_plan("takeoff", group_mask):
            if not self.is_active:
                return super().take_off(height, duration)
            self._warn(f"{self.name}.takeoff: it flies; a real vehicle ignores the command")
        return done(None)

    @override
    def land(self, height: float | None, duration: float, group_mask: int = 0) -> "Future[Any]":
        is_landing = self.is_active and not self._flies
        if self._may_plan("land", group_mask) and not is_landing:
            return super().land(height, duration)
        return done(None)

    @override
    def stop(self, group_mask: int = 0) -> "Future[Any]":
        if self._may_plan("stop", group_mask):
            self._stop_motors("stop")
        return done(None)

    @override
    def go_to(
        self,
        goal: Triple,
        yaw: float,
        duration: float,
        relative: bool = False,
        group_mask: int = 0,
    ) -> "Future[Any]":
        if self._may_plan("goTo", group_mask):
            return super().go_to(goal, yaw, duration, relative)
        return done(None)

    def upload_trajectory(
        self, trajectory_id: int, piece_offset: int, pieces: Sequence[PolynomialPiece]
    ) -> None:
        self._memory.upload(trajectory_id, piece_offset, pieces)

    def start_trajectory(
        self, trajectory_id: int, time_scale: float, reverse: bool, relative: bool, group_mask: int
    ) -> None:
        if self._may_plan("startTrajectory", group_mask):
            trajectory = Trajectory(self._memory[trajectory_id], time_scale, reverse)
            start = self.planned().position
            self._fly(trajectory.moved_to(start, None) if relative else trajectory)

    def notify_setpoints_stop(self, remain_valid_ms: int, group_mask: int) -> None:
        self._expiry = self._time() + remain_valid_ms / 1000.0

    @override
    def emergency(self) -> "Future[Any]":
        self._warn(f"{self.name}.emergency: it does not react to commands any more")
        self._stop_motors("emergency")
        self._locked = True
        return done(None)

    def arm(self, arm: bool) -> None:
        self._armed = arm

    def set_group_mask(self, group_mask: int) -> None:
        self.groups = group_mask

    def set_parameters(self, values: Mapping[str, float]) -> None:
        self._parameters.update(values)

    def get_parameter(self, name: str) -> float:
        return self._parameters[name]

    def send(self, setpoint: Setpoint) -> None:
        if self._locked:
            return
        # The firmware's commander makes the planner forget its plan (commander.c).
        super().stop()
        self._setpoint, self._expiry, self._sent = setpoint, math.inf, self._time()
        if isinstance(setpoint, MotorsOff):
            self._stop_motors("cmdStop")
        if isinstance(setpoint, Attitude):
            self._warn(f"{self.name}.cmdVel: an ideal vehicle has no attitude; it stays in place")

    def _stop_motors(self, method):
        height = self.motion.position[2] - self.initial_position[2]
        if height > _FALL_HEIGHT:
            self._warn(
                f"{self.name}.{method}: the motors stop {height:.2f} m above the start; a real "
                "vehicle falls, this one stays in place"
            )
        super().stop()
        self._setpoint = None

    def enable_avoidance(
        self, others: Sequence[VehicleBackend], settings: AvoidanceSettings
    ) -> None:
        motions = [other._motion for other in others if isinstance(other, SimulatedVehicle)]
        self._motion.avoid(motions, settings)

    def disable_avoidance(self) -> None:
        self._motion.avoid((), None)

    # State.

    @property
    def motion(self) -> SimulatedMotion:
        """Where the vehicle is, and how it moves."""
        return self._motion.now

    @motion.setter
    def motion(self, motion: SimulatedMotion) -> None:
        self._motion.now = motion

    @property
    def is_flying(self) -> bool:
        """Whether motors would run."""
        return self._setpoint is not None or self.is_active

    @property
    def led_color(self) -> Triple:
        """Red, green and blue, 0 to 1."""
        return self._parameters.led_color

    def state(self) -> VehicleState:
        *vectors, yaw = self.motion
        (x, y, z), (vx, vy, vz), (ax, ay, az) = (vector.tolist() for vector in vectors)
        rpy = attitude(self.motion.acceleration, yaw)
        return VehicleState((x, y, z), (vx, vy, vz), (ax, ay, az), rpy)

    def status(self) -> dict[str, Any]:
        seconds = math.floor(self._time())
        # Bits as supervisor.info of the firmware has them.
        bits = 0b1001 | self._armed << 1 | self.is_flying << 4 | self._locked << 6
        counts = ("num_rx_broadcast", "num_tx_broadcast", "num_rx_unicast", "num_tx_unicast")
        return {
            "id": self.name,
            "timestamp_sec": seconds,
            "timestamp_nsec": int((self._time() - seconds) * 1e9),
            "supervisor": bits,
            "battery": 4.2,
            "pm_state": 0,
            "rssi": 0,
            "latency_unicast": 0,
            **dict.fromkeys(counts, 0),
        }

    def next_motion(self, dt: float) -> SimulatedMotion:
        """Return where the vehicle is at the present time, ``dt`` (s) after `motion`."""
        now = self._time()
        if now > self._expiry:
            self._setpoint = None
        if self._setpoint is not None:
            if math.isinf(self._expiry) and now > self._sent + SETPOINT_TIMEOUT + dt:
                self._warn(
                    f"{self.name}: no setpoint for {SETPOINT_TIMEOUT:g} s; a real vehicle levels "
                    "out and stops its motors 2 s after the last one"
                )
            return self._motion.at_setpoint(self._setpoint, dt)
        # Also at the end of a landing.
        if self._flies or now - dt < self.trajectory.end:
            return self._motion.tracked(self.trajectory.goal(now), dt)
        return self._motion.held()

    def _warn(self, text: str) -> None:
        # A loop must not flood the terminal.
        if text not in self._warned:
            self._warned.add(text)
            _log.warning(text)
