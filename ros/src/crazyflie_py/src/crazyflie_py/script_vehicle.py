"""A running vehicle of a script: checks of its commands, its parameters and its state."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from typing import Any

from crazyflie_driver import srv
from crazyflie_fleet.separation import LOOK_AHEAD
from crazyflie_mission_api import Fleet
from crazyflie_mission_api.mission_vehicle import (
    AttitudeSetpoint,
    MotorsOffSetpoint,
    Move,
    PositionSetpoint,
    Setpoint,
    led_to,
)
from crazyflie_mission_api.ros_vehicle import RosVehicle, TimedPose, velocity_between
from crazyflie_model.angles import Triple, rpy_from_quaternion
from crazyflie_model.collision_avoidance import AvoidanceSettings
from crazyflie_model.limits import LEVEL_AGE
from crazyflie_msgs.msg import FlightStatus, VehicleStatus
from crazyflie_py.fleet import FleetVehicle
from crazyflie_py.simulated_parameters import SimulatedParameters
from crazyflie_py.swarm import STATUS_FIELDS, Order, ParameterStore, ScriptState
from crazyflie_utils import NodeHandle, ParameterError
from crazyflie_utils.parameters.types import FIRMWARE_NUMBER

_ANSWER_LIMIT = 15.0  #: Timeout of the answer to a command (s of the machine's clock).
_STATE_TIMEOUT = 10.0  #: Timeout of a pose (s of the vehicles' time).
_HOLD_DURATION = 0.8  #: Time in which a held vehicle stops (s).
_VELOCITY_SPAN = 0.2  #: Longest time between the two poses of a velocity (s).

_UNKNOWN: Triple = (math.nan, math.nan, math.nan)

#: Replaces infinite corners (m): the parameter server has no infinity.
_FIRMWARE_INFINITY = 1e9

_NOT_FLYING = (FlightStatus.UNKNOWN, FlightStatus.ON_GROUND)


def avoidance_parameters(settings: AvoidanceSettings) -> dict[str, float]:
    """Return the firmware parameters of collision avoidance.

    Names are those of bitcraze/crazyflie-firmware, collision_avoidance.c.
    """
    values: dict[str, float] = {
        "colAv.horizon": settings.horizon,
        "colAv.maxSpeed": settings.max_speed,
        "colAv.sidestepThrsh": settings.sidestep_threshold,
        "colAv.vorTol": settings.tolerance,
        "colAv.vorIters": settings.max_iterations,
    }
    for axis, radius, low, high in zip(
        "XYZ", settings.radii, settings.box_min, settings.box_max, strict=True
    ):
        values[f"colAv.ellipsoid{axis}"] = radius
        values[f"colAv.bboxMin{axis}"] = max(low, -_FIRMWARE_INFINITY)
        values[f"colAv.bboxMax{axis}"] = min(high, _FIRMWARE_INFINITY)
    return values


class CommandRefusedError(RuntimeError):
    """A vehicle refuses a command, or has not answered; the text names it and the reason."""


class ScriptConnection:
    """Handle and fleet that all vehicles of a script share."""

    def __init__(self, handle: NodeHandle, fleet: Fleet, is_unchecked: bool):
        self.handle = handle
        self.fleet = fleet
        self.is_unchecked = is_unchecked  #: Whether refusals are only warnings.
        self.said: set[str] = set()  #: See `SimulatedParameters`.

    def refuse(self, text: str) -> None:
        """Raise `CommandRefusedError`; with --unchecked warn."""
        if not self.is_unchecked:
            raise CommandRefusedError(f"{text}; with --unchecked this is a warning")
        self.handle.warn(text)

    def finish(
        self,
        what: str,
        calls: Mapping[str, "Future[Any]"],
        has_begun: Callable[[str], bool] = lambda name: False,
    ) -> None:
        """Wait for the answers of calls, by name of the vehicle, or until each has begun."""
        end = time.monotonic() + _ANSWER_LIMIT

        def waiting():
            return [name for name, call in calls.items() if not call.done() and not has_begun(name)]

        self.fleet.clock.wait_until(lambda: not waiting() or time.monotonic() > end, math.inf)
        failures = {name: f"no answer for {_ANSWER_LIMIT:g} s" for name in waiting()}
        for name, call in calls.items():
            if call.done() and call.exception() is not None:
                failures[name] = str(call.exception())
        if failures:
            self.refuse("; ".join(f"{name}: {what}: {text}" for name, text in failures.items()))


class FirmwareParameters:
    """The `ParameterStore` of a vehicle with firmware, behind the driver."""

    def __init__(self, vehicle: RosVehicle, connection: ScriptConnection):
        self.name = vehicle.name
        self._vehicle = vehicle
        self._connection = connection

    def update(self, values: Mapping[str, float]) -> None:
        """Set parameters; ValueError for unknown names."""
        for name in values:
            self[name]
        paths = {key.replace(".", "/"): value for key, value in values.items()}
        with self._connection.fleet.ending.commanding():
            for path, value in paths.items():
                self._connection.handle.set_param(f"/{self.name}/{path}", value)
            call = self._vehicle.call("update_params", srv.UpdateParams, [*paths])
        self._connection.finish("update_params", {self.name: call})

    def __getitem__(self, name: str) -> float:
        """Return a value; ValueError for an unknown name."""
        path = f"/{self.name}/{name.replace('.', '/')}"
        try:
            value: float = self._connection.handle.get_param(path, FIRMWARE_NUMBER)
        except ParameterError:
            raise ValueError(
                f"{self.name}: the firmware has no parameter {name}, since the driver has not "
                f"set {path}; expected one that `rosparam list /{self.name}` prints"
            ) from None
        return value


class ScriptVehicle:
    """One running vehicle: checks and records of its commands, and its state."""

    def __init__(
        self,
        vehicle: RosVehicle,
        config: FleetVehicle,
        connection: ScriptConnection,
        has_firmware: bool,
    ):
        self.name = vehicle.name
        self.vehicle = vehicle
        self.config = config
        self.pose = vehicle.pose
        self.parameters: ParameterStore = (
            FirmwareParameters(vehicle, connection)
            if has_firmware
            else SimulatedParameters(self, connection.said)
        )
        self.groups = 0  #: Mask of the groups that the script has made it a member of.
        self.is_landing = False  #: Whether the script has landed it; it is not held then.
        self._connection = connection
        self._avoids = False  # Its firmware avoids collisions.
        self._free_until = -math.inf
        # The last setpoint, and its time (s); the position at which the vehicle is held (m).
        self._streamed: tuple[Setpoint, float] | None = None
        self._held_at: Triple | None = None
        self._last_pose: TimedPose | None = None
        self._velocity = _UNKNOWN

    # Commands.

    def set_group_mask(self, group_mask: int) -> None:
        """Make the vehicle a member of groups, a bit each."""
        with self._connection.fleet.ending.commanding():
            self.end_setpoints()
            call = self.vehicle.set_group_mask(group_mask)
        self._connection.finish("set_group_mask", {self.name: call})
        self.groups = group_mask

    def is_member(self, group_mask: int) -> bool:
        """Return whether a command to groups concerns the vehicle."""
        return group_mask == 0 or bool(group_mask & self.groups)

    def prepare(self, order: Order) -> None:
        """Refuse a command to a goal outside the fence; otherwise record its consequences."""
        if order.goal is not None:
            self._check("goTo" if order.name == "go_to" else order.name, order.goal)
        if order.flies:
            self.note_flight()
        # It is not held while it takes off or lands.
        self._free_until = self._connection.fleet.time() + order.duration

    def send(self, setpoint: Setpoint) -> None:
        """Send a setpoint; while the vehicle is too near to another, send one that holds it."""
        with self._connection.fleet.ending.commanding():
            self.note_flight()
            self.vehicle.send(self._passed(setpoint))

    def checked_yaw(self, yaw: float) -> float:
        """Return a yaw that the vehicle can have, rad; another is refused."""
        if yaw == 0.0 or self.vehicle.has_yaw:
            return yaw
        self._connection.refuse(
            f"{self.name}: a yaw of {yaw:.3g}: its controller keeps the heading 0; expected 0"
        )
        return 0.0

    def _check(self, what, goal):
        """Refuse a goal (m) outside the vehicle's fence, or below the ground."""
        bounds, place = self.vehicle.bounds, self.vehicle.position() or self.config.position
        goal = [old if math.isnan(new) else new for new, old in zip(goal, place, strict=True)]
        for value, low, high, axis in zip(goal, bounds.lower, bounds.upper, "xyz", strict=True):
            if not low <= value <= high:
                self._connection.refuse(
                    f"{self.name}: {what}: {axis} is {value:.3g} m, outside the fence; expected "
                    f"{low:g} to {high:g} m"
                )

    def avoid(self, others: Sequence[object], settings: AvoidanceSettings | None) -> None:
        """Set collision avoidance of the firmware, which determines the others; None ends it."""
        if not self.vehicle.uses_driver:
            if settings is not None:
                self._connection.handle.warn(
                    f"{self.name}: enableCollisionAvoidance has no effect: the fleet keeps "
                    "vehicles that its controllers fly apart, by the buffers of the fleet file"
                )
            return
        if settings is None:
            self.parameters.update({"colAv.enable": 0})
            self._avoids = False
            return
        try:
            self.parameters.update({**avoidance_parameters(settings), "colAv.enable": 1})
            self._avoids = True
        except ValueError as error:
            self._connection.refuse(f"{self.name}: enableCollisionAvoidance: {error}")

    # The flight is ended here.

    def note_flight(self) -> None:
        """Record that the vehicle must be landed at the end of the script."""
        self.is_landing = False
        self._connection.fleet.adopt(self.name)

    def note_landing(self, group_mask: int) -> None:
        """Record that the script lands the vehicles of groups."""
        self.is_landing = self.is_landing or self.is_member(group_mask)

    def has_begun(self) -> bool:
        """Return whether a takeoff under the workspace's controller is under way."""
        status = self.vehicle.flight_status.state
        return status in (FlightStatus.TAKING_OFF, FlightStatus.FLYING)

    # Distances from other vehicles.

    def _passed(self, setpoint: Setpoint) -> Setpoint:
        """Return the setpoint to send in place of one that a script sends."""
        self._streamed = setpoint, self._connection.fleet.time()
        if self._held_at is None or isinstance(setpoint, AttitudeSetpoint | MotorsOffSetpoint):
            return setpoint
        return PositionSetpoint(self._held_at, self.vehicle.heading())

    def end_setpoints(self) -> None:
        """Record that a command follows setpoints."""
        self._streamed = self._held_at = None

    @property
    def may_be_held(self) -> bool:
        """Whether it flies, and neither takes off, nor lands, nor avoids others by itself."""
        is_flying = bool(self.vehicle.driver_status.supervisor & VehicleStatus.FLYING)
        is_free = self._connection.fleet.time() < self._free_until
        return is_flying and not is_free and not self.is_landing and not self._avoids

    def streamed_goal(self, place: Triple) -> Triple | None:
        """Return the place to which setpoints move it from a place (m); None without setpoints."""
        if self._streamed is None:
            return None
        setpoint, time = self._streamed
        if self._connection.fleet.time() - time > LEVEL_AGE:
            return None
        return led_to(setpoint, place, self.vehicle.heading(), LOOK_AHEAD)

    def hold(self, place: Triple) -> None:
        """Hold it at a position (m)."""
        if self.streamed_goal(place) is not None:
            self._held_at = place
            return
        move = Move(place, self.vehicle.heading(), _HOLD_DURATION)
        self.vehicle.go_to(move).add_done_callback(self._note_hold)

    def release(self) -> None:
        """Release it: it follows its setpoints again."""
        self._held_at = None

    def _note_hold(self, answer):
        if answer.exception() is not None:
            self._connection.handle.warn(
                f"{self.name}: the vehicle cannot be held: {answer.exception()}"
            )

    # State.

    def state(self) -> ScriptState:
        """Return the state; its velocity is that between two poses.

        `TimeoutError`: no pose has come for 10 s.
        """
        pose, last = self._wait(lambda pose: True), self._last_pose
        if last is None or pose.time - last.time > _VELOCITY_SPAN:
            last, pose = pose, self._wait(lambda new: new.time > pose.time)
        if pose.time > last.time:
            self._velocity = velocity_between(last, pose)
        self._last_pose = pose
        rpy = rpy_from_quaternion(*pose.rotation)
        return ScriptState(pose.position, self._velocity, _UNKNOWN, rpy)

    def _wait(self, condition: Callable[[TimedPose], bool]) -> TimedPose:
        def is_there():
            pose = self.pose()
            return pose is not None and condition(pose)

        clock = self._connection.fleet.clock
        clock.wait_until(is_there, clock.time() + _STATE_TIMEOUT)
        pose = self.pose()
        if pose is None:
            raise TimeoutError(
                f"{self.name}: no position for {_STATE_TIMEOUT:g} s; does motion "
                "capture track the vehicle?"
            )
        return pose

    def status(self) -> dict[str, Any]:
        """Return the status with the keys of crazyswarm2's Crazyflie.get_status."""
        status = self.vehicle.driver_status
        supervisor, battery = status.supervisor, status.battery_voltage
        if not self.vehicle.uses_driver:
            is_flying = self.vehicle.flight_status.state not in _NOT_FLYING
            ready = VehicleStatus.CAN_BE_ARMED | VehicleStatus.ARMED | VehicleStatus.CAN_FLY
            supervisor, battery = ready | is_flying * VehicleStatus.FLYING, math.nan
        return {
            "id": self.name,
            "timestamp_sec": status.header.stamp.secs,
            "timestamp_nsec": status.header.stamp.nsecs,
            "supervisor": supervisor,
            "battery": battery,
            **{name: getattr(status, name) for name in STATUS_FIELDS},
        }
