"""Keeps the vehicles of a script that the driver alone flies apart, as a fleet does."""

import math
from collections.abc import Sequence

import numpy as np

from crazyflie_fleet.separation import LOOK_AHEAD, Separation
from crazyflie_mission_api.mission_vehicle import (
    SETPOINT_TIMEOUT,
    AttitudeSetpoint,
    MotorsOffSetpoint,
    Move,
    PositionSetpoint,
    Setpoint,
    led_to,
)
from crazyflie_mission_api.ros_vehicle import RosVehicle, TimedPose, velocity_between
from crazyflie_model.angles import Triple
from crazyflie_msgs.msg import VehicleStatus
from crazyflie_py.ros_connection import ScriptConnection

_HOLD_DURATION = 0.8  #: Time in which a held vehicle stops (s).

_SHORTEST_SPAN = 0.02  #: Least time between two poses for a velocity (s).
_LONGEST_SPAN = 0.3  #: Age of the first pose above which it is not used for a velocity (s).
_LOWEST_SPEED = 0.05  #: Speed below which a vehicle hovers (m/s).
_REPEAT = 2.0  #: Shortest time between two warnings of a vehicle (s).


class HeldVehicle:
    """One vehicle."""

    def __init__(self, vehicle: RosVehicle, connection: ScriptConnection):
        self.name = vehicle.name
        #: is_landing, avoids: Whether it lands, and whether its firmware avoids collisions; it is
        #: not held then.
        self.is_landing = False
        self.avoids = False
        self._free_until = -math.inf
        self._vehicle = vehicle
        self._connection = connection
        # The last setpoint, and its time (s); the position at which the vehicle is held (m).
        self._streamed: tuple[Setpoint, float] | None = None
        self._held_at: Triple | None = None

    def passed(self, setpoint: Setpoint) -> Setpoint:
        """Return the setpoint to send in place of one that a script sends."""
        self._streamed = setpoint, self._connection.fleet.time()
        if self._held_at is None or isinstance(setpoint, AttitudeSetpoint | MotorsOffSetpoint):
            return setpoint
        return PositionSetpoint(self._held_at, self._vehicle.heading())

    def free(self, duration: float) -> None:
        """Record that it takes off or lands, for a duration (s)."""
        self._free_until = self._connection.fleet.time() + duration

    def end_setpoints(self) -> None:
        """Record that a command follows setpoints."""
        self._streamed = self._held_at = None

    @property
    def may_be_held(self) -> bool:
        """Whether it flies, and neither takes off, nor lands, nor avoids others by itself."""
        is_flying = bool(self._vehicle.driver_status.supervisor & VehicleStatus.FLYING)
        is_free = self._connection.fleet.time() < self._free_until
        return is_flying and not is_free and not self.is_landing and not self.avoids

    def pose(self) -> TimedPose | None:
        """Return its position, m; None if that is not known."""
        return self._vehicle.pose()

    def streamed_goal(self, place: Triple) -> Triple | None:
        """Return the place to which setpoints move it from a place (m); None without setpoints."""
        if self._streamed is None:
            return None
        setpoint, time = self._streamed
        if self._connection.fleet.time() - time > SETPOINT_TIMEOUT:
            return None
        return led_to(setpoint, place, self._vehicle.heading(), LOOK_AHEAD)

    def hold(self, place: Triple) -> None:
        """Hold it at a position (m)."""
        if self.streamed_goal(place) is not None:
            self._held_at = place
            return
        move = Move(place, self._vehicle.heading(), _HOLD_DURATION)
        self._vehicle.go_to(move).add_done_callback(self._note_hold)

    def release(self) -> None:
        """Release it: it follows its setpoints again."""
        self._held_at = None

    def _note_hold(self, answer):
        if answer.exception() is not None:
            self._connection.handle.warn(
                f"{self.name}: the vehicle cannot be held: {answer.exception()}"
            )


class SeparationWatch:
    """Holds vehicles that come too near to another, by the rule of a fleet.

    The goal of a vehicle without setpoints follows from its velocity.

    Parameters
    ----------
    vehicles : sequence of HeldVehicle
    buffers : sequence of float
        Radii of the space that is reserved for each vehicle, m.
    connection : Connection
        Logs warnings; if unchecked, vehicles are not held.
    """

    def __init__(
        self,
        vehicles: Sequence[HeldVehicle],
        buffers: Sequence[float],
        connection: ScriptConnection,
    ):
        self._vehicles = vehicles
        self._separation = Separation(buffers)
        self._connection = connection
        self._poses: list[TimedPose | None] = [None] * len(vehicles)
        self._velocities = np.zeros((len(vehicles), 3))
        self._held: set[int] = set()

    def update(self) -> None:
        """Check all vehicles, and hold or release them."""
        positions = np.full((len(self._vehicles), 3), math.nan)
        goals = positions.copy()
        for k, vehicle in enumerate(self._vehicles):
            pose = vehicle.pose()
            self._measure(k, pose)
            if pose is not None:
                positions[k] = pose.position
                streamed = vehicle.streamed_goal(pose.position)
                ahead = positions[k] + LOOK_AHEAD * self._velocities[k]
                goals[k] = ahead if streamed is None else streamed
        approaching, pairs = self._separation.update(positions, self._velocities, goals)
        held = {int(k) for k in np.flatnonzero(approaching) if self._vehicles[int(k)].may_be_held}
        for k in sorted(held - self._held):
            self._begin(k, pairs, positions[k])
        for k in self._held - held:
            self._vehicles[k].release()
        self._held = held

    def _measure(self, k, pose):
        last = self._poses[k]
        span = math.inf if pose is None or last is None else pose.time - last.time
        if 0.0 <= span < _SHORTEST_SPAN:
            return
        self._poses[k] = pose
        self._velocities[k] = 0.0
        if 0.0 < span <= _LONGEST_SPAN:
            velocity = velocity_between(last, pose)
            if np.linalg.norm(velocity) > _LOWEST_SPEED:
                self._velocities[k] = velocity

    def _begin(self, k, pairs, position):
        (pair, *_) = [pair for pair in pairs if k in pair[:2]]
        other = self._vehicles[pair.second if pair.first == k else pair.first]
        x, y, z = position.tolist()
        is_held = not self._connection.is_unchecked
        self._connection.handle.warn(
            f"{self._vehicles[k].name} comes too near to {other.name}, now or in {LOOK_AHEAD:g} "
            f"s: {pair.distance:.2f} m; expected at least {pair.limit:.2f} m (vertical distances "
            f"are halved); {'the vehicle is held' if is_held else 'the vehicle flies on'}",
            throttle=_REPEAT,
            key=f"separation {self._vehicles[k].name}",
        )
        if is_held:
            self._vehicles[k].hold((x, y, z))
