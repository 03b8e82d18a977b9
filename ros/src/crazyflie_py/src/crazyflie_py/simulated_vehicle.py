"""One ideal vehicle of --sim: it is where its planner, or its setpoint, says."""

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crazyflie_model.angles import Triple
from crazyflie_model.collision_avoidance import AvoidanceSettings, CollisionAvoidance
from crazyflie_model.polynomials import PIECE_SIZE, PolynomialPiece
from crazyflie_model.units import GRAVITY
from crazyflie_py.backend import VehicleBackend, VehicleState
from crazyflie_py.fleet import FleetVehicle
from crazyflie_py.setpoints import (
    Attitude,
    FullState,
    Hover,
    MotorsOff,
    Position,
    Setpoint,
    VelocityWorld,
)
from crazyflie_py.simulated_parameters import SimulatedParameters
from crazyflie_virtual.firmware.planner import (
    ACTIVE,
    DEFINITIONS,
    IN_MEMORY,
    MEMORY_SIZE,
    POLYNOMIALS,
    Planner,
)
from crazyflie_virtual.firmware.states import Estimate

Array = NDArray[np.float64]

_log = logging.getLogger(__name__)

_ROOM = MEMORY_SIZE // PIECE_SIZE
"""Pieces in the trajectory memory."""

_FALL_HEIGHT = 0.1
"""Height above the start from which motors are not stopped without a warning, m."""

_SETPOINT_TIMEOUT = 0.5
"""Age of a setpoint at which the firmware levels out, s (commander.h, WDT_TIMEOUT_STABILIZE)."""


class Motion(NamedTuple):
    """Position (m), velocity (m/s), acceleration (m/s^2), each (3,), and yaw (rad)."""

    position: Array
    velocity: Array
    acceleration: Array
    yaw: float


class SimulatedVehicle:
    """A vehicle of `crazyflie_py.backend.VehicleBackend`.

    Parameters
    ----------
    vehicle : FleetVehicle
    time : callable
        Returns the time of the simulation, s.
    max_speed, disturbance : float
        Options --maxvel and --disturbance, m/s.

    Attributes
    ----------
    motion : Motion
    """

    def __init__(
        self,
        vehicle: FleetVehicle,
        time: Callable[[], float],
        max_speed: float,
        disturbance: float,
    ):
        self.name, self.id, self.initial_position, _ = vehicle
        self._time = time
        self._max_speed = max_speed
        self._disturbance = disturbance
        self._planner = Planner()
        self._parameters = SimulatedParameters(self.name, self._planner)
        self._slots: dict[int, tuple[int, range]] = {}
        self._setpoint: Setpoint | None = None
        self._expiry = math.inf
        self._sent = 0.0
        self._locked = False
        self._armed = True
        self._warned: set[str] = set()
        self._avoidance: CollisionAvoidance | None = None
        self._others: list[SimulatedVehicle] = []
        self.motion = _held(np.array(self.initial_position), 0.0)

    # Commands.

    def _may_plan(self, method: str, group_mask: int) -> bool:
        """Prepare for a high-level command; return whether it concerns this vehicle."""
        if self._locked or (group_mask and not group_mask & self._planner.groups):
            return False
        if self._setpoint is not None and math.isinf(self._expiry):
            self._warn(
                f"{self.name}.{method}: setpoints were not ended by notifySetpointsStop; "
                "a real vehicle ignores the command"
            )
        self._setpoint = None
        if self._planner.state not in ACTIVE:
            self._planner.tell_state(self._estimate())
        return True

    def take_off(self, height: float, duration: float, group_mask: int) -> None:
        if self._may_plan("takeoff", group_mask) and self._planner.take_off(
            self._time(), height, None, duration
        ):
            self._warn(f"{self.name}.takeoff: it flies; a real vehicle ignores the command")

    def land(self, height: float, duration: float, group_mask: int) -> None:
        if self._may_plan("land", group_mask):
            self._planner.land(self._time(), height, None, duration)

    def stop(self, group_mask: int) -> None:
        if self._may_plan("stop", group_mask):
            self._stop_motors("stop")

    def go_to(
        self, goal: Triple, yaw: float, duration: float, relative: bool, group_mask: int
    ) -> None:
        if self._may_plan("goTo", group_mask):
            self._planner.go_to(self._time(), goal, yaw, duration, relative, linear=False)

    def upload_trajectory(
        self, trajectory_id: int, piece_offset: int, pieces: Sequence[PolynomialPiece]
    ) -> None:
        where = f"{self.name}.uploadTrajectory"
        room = range(piece_offset, piece_offset + len(pieces))
        if room.stop > _ROOM:
            raise ValueError(
                f"{where}: {len(pieces)} pieces from pieceOffset {piece_offset} on; expected no "
                f"more than {_ROOM} in all, the room in the memory"
            )
        slot = self._slots.get(trajectory_id, (len(self._slots), room))[0]
        if slot >= DEFINITIONS:
            raise ValueError(
                f"{where}: trajectoryId is {trajectory_id}; expected one of the {DEFINITIONS} that "
                f"are in use: {sorted(self._slots)}"
            )
        if trajectory_id >= DEFINITIONS:
            self._warn(
                f"{where}: trajectoryId is {trajectory_id}; the firmware expects 0 to "
                f"{DEFINITIONS - 1}, and a real vehicle refuses it"
            )
        for other, (_, taken) in self._slots.items():
            if other != trajectory_id and set(taken) & set(room):
                self._warn(
                    f"{where}: pieces {room.start} to {room.stop - 1} overwrite trajectory "
                    f"{other}; another pieceOffset keeps both"
                )
        self._slots[trajectory_id] = slot, room
        begin = piece_offset * PIECE_SIZE
        data = b"".join(piece.pack() for piece in pieces)
        self._planner.memory[begin : begin + len(data)] = data
        self._planner.define(slot, IN_MEMORY, POLYNOMIALS, begin, len(pieces))

    def start_trajectory(
        self, trajectory_id: int, time_scale: float, reverse: bool, relative: bool, group_mask: int
    ) -> None:
        if trajectory_id not in self._slots:
            raise ValueError(
                f"{self.name}.startTrajectory: trajectoryId is {trajectory_id}; expected one that "
                f"uploadTrajectory has written: {sorted(self._slots) or 'there is none'}"
            )
        if self._may_plan("startTrajectory", group_mask):
            slot, _ = self._slots[trajectory_id]
            self._planner.start(self._time(), slot, time_scale, reverse, relative, False)

    def notify_setpoints_stop(self, remain_valid_ms: int, group_mask: int) -> None:
        self._expiry = self._time() + remain_valid_ms / 1000.0

    def emergency(self) -> None:
        self._warn(f"{self.name}.emergency: it does not react to commands any more")
        self._stop_motors("emergency")
        self._locked = True

    def arm(self, arm: bool) -> None:
        self._armed = arm

    def set_group_mask(self, group_mask: int) -> None:
        self._planner.groups = group_mask

    def set_parameters(self, values: Mapping[str, float]) -> None:
        self._parameters.update(values)

    def get_parameter(self, name: str) -> float:
        return self._parameters[name]

    def send(self, setpoint: Setpoint) -> None:
        if self._locked:
            return
        # The firmware's commander makes the planner forget its plan (commander.c).
        self._planner.stop()
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
        self._planner.stop()
        self._setpoint = None

    def enable_avoidance(
        self, others: Sequence[VehicleBackend], settings: AvoidanceSettings
    ) -> None:
        self._others = [other for other in others if isinstance(other, SimulatedVehicle)]
        self._avoidance = CollisionAvoidance(settings)

    def disable_avoidance(self) -> None:
        self._avoidance = None

    # State.

    @property
    def is_flying(self) -> bool:
        """Whether motors would run."""
        return self._setpoint is not None or self._planner.state in ACTIVE

    @property
    def led_color(self) -> Triple:
        """Red, green and blue, 0 to 1."""
        return self._parameters.led_color

    def state(self) -> VehicleState:
        x, v, a, yaw = self.motion
        return VehicleState(_triple(x), _triple(v), _triple(a), attitude(a, yaw))

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

    # Steps.

    def next_motion(self, dt: float) -> Motion:
        """Return where the vehicle is at the present time, ``dt`` (s) after `motion`."""
        now = self._time()
        if now > self._expiry:
            self._setpoint = None
        if self._setpoint is not None:
            return self._track_setpoint(self._setpoint, now, dt)
        goal = self._planner.goal(now) if self._planner.state in ACTIVE else None
        # Ends a landing.
        self._planner.setpoint(now, self._estimate())
        if goal is None:
            return _held(self.motion.position, self.motion.yaw)
        return self._limited(_motion(goal), dt)

    def _track_setpoint(self, setpoint, now, dt):
        if math.isinf(self._expiry) and now > self._sent + _SETPOINT_TIMEOUT + dt:
            self._warn(
                f"{self.name}: no setpoint for {_SETPOINT_TIMEOUT:g} s; a real vehicle levels out "
                "and stops its motors 2 s after the last one"
            )
        yaw, zero = self.motion.yaw, np.zeros(3)
        if isinstance(setpoint, FullState):
            return self._limited(_motion(setpoint), dt)
        if isinstance(setpoint, Position):
            goal = Motion(np.array(setpoint.position), zero, zero, setpoint.yaw)
            return self._approached(self._limited(goal, dt), dt)
        if isinstance(setpoint, VelocityWorld):
            return self._at_velocity(np.array(setpoint.velocity), setpoint.yaw_rate, dt)
        if isinstance(setpoint, Hover):
            c, s = math.cos(yaw), math.sin(yaw)
            climb = (setpoint.height - self.motion.position[2]) / dt
            ahead, left = setpoint.vx, setpoint.vy
            velocity = np.array([c * ahead - s * left, s * ahead + c * left, climb])
            return self._at_velocity(velocity, setpoint.yaw_rate, dt)
        return _held(self.motion.position, yaw)

    def _limited(self, goal, dt):
        """Return a goal as far as avoidance and --maxvel permit."""
        position = velocity = None
        if self._avoidance is not None:
            position, velocity = self._avoidance.position_setpoint(
                self.motion.position, self._other_positions(), goal.position, goal.velocity
            )
            if not np.array_equal(position, goal.position):
                goal = self._approached(goal._replace(position=position), dt)
            else:
                goal = goal._replace(velocity=velocity)
        way = goal.position - self.motion.position
        if np.linalg.norm(way) <= self._max_speed * dt:
            return goal
        return self._approached(
            goal._replace(position=self.motion.position + _clamped(way, self._max_speed * dt)), dt
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
        velocity = _clamped(velocity, self._max_speed)
        if self._disturbance:
            velocity = velocity + self._disturbance * np.random.normal(size=3)
        yaw = self.motion.yaw + math.radians(yaw_rate) * dt
        return Motion(position + dt * velocity, velocity, np.zeros(3), yaw)

    def _other_positions(self):
        return np.array([other.motion.position for other in self._others]).reshape(-1, 3)

    def _estimate(self) -> Estimate:
        (x, y, z), (vx, vy, vz) = self.motion.position.tolist(), self.motion.velocity.tolist()
        yaw = math.degrees(self.motion.yaw)
        return Estimate(x=x, y=y, z=z, vx=vx, vy=vy, vz=vz, yaw=yaw)

    def _warn(self, text):
        # A loop must not flood the terminal.
        if text not in self._warned:
            self._warned.add(text)
            _log.warning(text)


def attitude(acceleration: Array, yaw: float) -> Triple:
    """Return roll, pitch and yaw (rad) of a multirotor that accelerates, by differential flatness.

    Without rotation about its thrust: the body's x axis is above the heading. Acceleration of shape
    (3,), m/s^2.
    """
    ax, ay, az = acceleration
    c, s = math.cos(yaw), math.sin(yaw)
    ahead, left, up = c * ax + s * ay, c * ay - s * ax, az + GRAVITY
    pitch = math.atan2(ahead, up)
    return math.atan2(-left, math.hypot(ahead, up)), pitch, yaw


def _motion(goal):
    vectors = (goal.position, goal.velocity, goal.acceleration)
    position, velocity, acceleration = map(np.array, vectors)
    return Motion(position, velocity, acceleration, goal.yaw)


def _held(position, yaw):
    return Motion(position, np.zeros(3), np.zeros(3), yaw)


def _clamped(vector, limit):
    length = float(np.linalg.norm(vector))
    return vector * (limit / length) if length > limit else vector


def _triple(vector: Array) -> Triple:
    x, y, z = vector.tolist()
    return x, y, z
