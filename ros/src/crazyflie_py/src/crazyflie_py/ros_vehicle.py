"""A vehicle of Crazyswarm's API by ROS: behind the driver, or under the workspace's controller."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from typing import Any

from geometry_msgs.msg import Twist, Vector3
from std_msgs.msg import Empty
from std_srvs.srv import SetBool
from typing_extensions import override

from crazyflie_driver import srv
from crazyflie_driver.msg import FullState as FullStateMessage
from crazyflie_driver.msg import Hover as HoverMessage
from crazyflie_driver.msg import Position as PositionMessage
from crazyflie_driver.msg import VelocityWorld as VelocityWorldMessage
from crazyflie_fleet.conversions import full_state_message, to_message
from crazyflie_fleet.settings import FirmwareNumber
from crazyflie_mission_api.mission_vehicle import Clock
from crazyflie_mission_api.ros_vehicle import RosVehicle, TimedPose, velocity_between
from crazyflie_model.angles import Triple, rpy_from_quaternion
from crazyflie_model.collision_avoidance import AvoidanceSettings
from crazyflie_model.polynomials import Goal, PolynomialPiece
from crazyflie_msgs.msg import FlightStatus, VehicleStatus
from crazyflie_py.backend import VehicleBackend, VehicleState
from crazyflie_py.ros_connection import ScriptConnection
from crazyflie_py.separation_watch import HeldVehicle
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
from crazyflie_utils import NodeHandle, ParameterError
from crazyflie_utils.topics import Publisher

#: Timeout of the connection before the first setpoint (s of the machine's clock).
_CONNECTION_LIMIT = 2.0

_TOPICS: dict[type, tuple[str, Any]] = {
    FullState: ("cmd_full_state", FullStateMessage),
    Position: ("cmd_position", PositionMessage),
    VelocityWorld: ("cmd_velocity_world", VelocityWorldMessage),
    Hover: ("cmd_hover", HoverMessage),
    Attitude: ("cmd_vel", Twist),
    MotorsOff: ("cmd_stop", Empty),
}

_STATE_TIMEOUT = 10.0  #: Timeout of a pose (s of the vehicles' time).
_VELOCITY_SPAN = 0.2  #: Longest time between the two poses of a velocity (s).

_UNKNOWN: Triple = (math.nan, math.nan, math.nan)

#: Replaces infinite corners (m): the parameter server has no infinity.
_FIRMWARE_INFINITY = 1e9

_NOT_FLYING = (FlightStatus.UNKNOWN, FlightStatus.ON_GROUND)


class SetpointPublishers:
    """Publishes the setpoints of one vehicle."""

    def __init__(self, handle: NodeHandle, vehicle: RosVehicle):
        self._handle = handle
        self._vehicle = vehicle
        self._publishers: dict[type, Publisher] = {}

    def publish(self, setpoint: Setpoint) -> None:
        """Publish a setpoint; ValueError for one that the vehicle cannot follow."""
        if isinstance(setpoint, Attitude) and not self._vehicle.uses_driver:
            raise ValueError(
                f"{self._vehicle.name}: cmdVel cannot be followed: a controller of the workspace "
                "flies it; expected cmdPosition, cmdFullState, cmdVelocityWorld or cmdHover"
            )
        publisher = self._publishers.get(type(setpoint)) or self._connect(type(setpoint))
        publisher.publish(self._message(setpoint))

    def _connect(self, kind):
        name, message_type = _TOPICS[kind]
        top = self._vehicle.services["go_to"].rpartition("/")[0]
        publisher = self._publishers[kind] = self._handle.publisher(f"{top}/{name}", message_type)
        end = time.monotonic() + _CONNECTION_LIMIT
        while not publisher.has_subscribers() and time.monotonic() < end:
            time.sleep(0.01)
        return publisher

    def _message(self, setpoint):
        message = message_of(setpoint)
        if hasattr(message, "header"):
            message.header.stamp = self._handle.stamp()
        return message


def message_of(setpoint: Setpoint) -> Any:
    """Return the driver's message, without a stamp; its yaw rates are clockwise, in deg/s."""
    if isinstance(setpoint, FullState):
        goal = Goal(
            setpoint.position,
            setpoint.velocity,
            setpoint.acceleration,
            setpoint.yaw,
            setpoint.omega[2],
        )
        message = full_state_message(goal)
        message.twist.angular = Vector3(*setpoint.omega)
        return message
    if isinstance(setpoint, Position):
        x, y, z = setpoint.position
        return PositionMessage(x=x, y=y, z=z, yaw=math.degrees(setpoint.yaw))
    if isinstance(setpoint, VelocityWorld):
        return VelocityWorldMessage(vel=Vector3(*setpoint.velocity), yawRate=-setpoint.yaw_rate)
    if isinstance(setpoint, Hover):
        return HoverMessage(
            vx=setpoint.vx, vy=setpoint.vy, yawrate=-setpoint.yaw_rate, zDistance=setpoint.height
        )
    if isinstance(setpoint, Attitude):
        linear = Vector3(setpoint.pitch, setpoint.roll, setpoint.thrust)
        return Twist(linear, Vector3(0.0, 0.0, -setpoint.yaw_rate))
    return Empty()


class RosStates:
    """States of one vehicle; accelerations are not known, NaN."""

    def __init__(self, vehicle: RosVehicle, clock: Clock):
        self._vehicle = vehicle
        self._clock = clock
        self._last: TimedPose | None = None
        self._velocity = _UNKNOWN

    def state(self) -> VehicleState:
        """Return the state; its velocity is that between two poses.

        Raises
        ------
        TimeoutError
            No pose has come for 10 s.
        """
        pose, last = self._wait(lambda pose: True), self._last
        if last is None or pose.time - last.time > _VELOCITY_SPAN:
            last, pose = pose, self._wait(lambda new: new.time > pose.time)
        if pose.time > last.time:
            self._velocity = velocity_between(last, pose)
        self._last = pose
        rpy = rpy_from_quaternion(*pose.rotation)
        return VehicleState(pose.position, self._velocity, _UNKNOWN, rpy)

    def _wait(self, condition: Callable[[TimedPose], bool]) -> TimedPose:
        def is_there():
            pose = self._vehicle.pose()
            return pose is not None and condition(pose)

        self._clock.wait_until(is_there, self._clock.time() + _STATE_TIMEOUT)
        pose = self._vehicle.pose()
        if pose is None:
            raise TimeoutError(
                f"{self._vehicle.name}: no position for {_STATE_TIMEOUT:g} s; does motion capture "
                "track it?"
            )
        return pose


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


class RosVehicleBackend(VehicleBackend):
    """One vehicle; see `crazyflie_py.backend.VehicleBackend`."""

    def __init__(
        self,
        vehicle: RosVehicle,
        vehicle_id: int,
        position: Triple | None,
        connection: ScriptConnection,
        has_firmware: bool,
    ):
        self.name = vehicle.name
        self.id = vehicle_id
        self._vehicle = vehicle
        self._connection = connection
        self._setpoints = SetpointPublishers(connection.handle, vehicle)
        self._states = RosStates(vehicle, connection.fleet.clock)
        self.held = HeldVehicle(vehicle, connection)
        self._groups = 0
        self._parameters = (
            None if has_firmware else SimulatedParameters(self.name, self, connection.said)
        )
        if position is None:
            place = vehicle.position()
            position = (math.nan,) * 3 if place is None else place
        self.initial_position = position

    # Commands.

    @override
    def take_off(self, height: float, duration: float, group_mask: int = 0) -> None:
        calls = {self.name: self.begin_takeoff(height, duration, group_mask)}
        self._connection.finish("takeoff", calls, lambda _: self.has_begun())

    def begin_takeoff(self, height: float, duration: float, group_mask: int) -> "Future[Any]":
        """Call takeoff; the future is done when the vehicle takes off, or has refused."""
        self.check_takeoff(height)
        self.held.free(duration)
        self.held.end_setpoints()
        return self._vehicle.take_off(height, duration, group_mask)

    def check_takeoff(self, height: float) -> None:
        """Refuse a height (m) out of the fence; note the flight otherwise."""
        x, y, _ = self._vehicle.position() or self.initial_position
        self._check("takeoff", (x, y, height))
        self.note_flight()

    def is_member(self, group_mask: int) -> bool:
        """Return whether a command to groups concerns the vehicle."""
        return group_mask == 0 or bool(group_mask & self._groups)

    @override
    def land(self, height: float | None, duration: float, group_mask: int = 0) -> None:
        self.held.free(duration)
        self._command("land", self._vehicle.land(height, duration, group_mask))
        self.note_landing(group_mask)

    @override
    def stop(self, group_mask: int = 0) -> None:
        self._command("stop", self._vehicle.stop(group_mask))

    @override
    def go_to(
        self,
        goal: Triple,
        yaw: float,
        duration: float,
        relative: bool = False,
        group_mask: int = 0,
    ) -> None:
        if not relative:
            self._check("goTo", goal)
        self.note_flight()
        yaw = self.checked_yaw(yaw)
        call = self._vehicle.go_to(goal, yaw, duration, relative, group_mask)
        self._command("go_to", call)

    @override
    def start_trajectory(
        self, trajectory_id: int, time_scale: float, reverse: bool, relative: bool, group_mask: int
    ) -> None:
        self.note_flight()
        arguments = (group_mask, trajectory_id, time_scale, reverse, relative)
        self._serve("start_trajectory", srv.StartTrajectory, *arguments)

    @override
    def notify_setpoints_stop(self, remain_valid_ms: int, group_mask: int) -> None:
        self._serve("notify_setpoints_stop", srv.NotifySetpointsStop, group_mask, remain_valid_ms)

    @override
    def emergency(self) -> None:
        self._connection.finish("emergency", {self.name: self.begin_emergency()})

    def begin_emergency(self) -> "Future[Any]":
        """Stop the motors; the future is done when the answer has come."""
        return self._vehicle.emergency()

    @override
    def arm(self, arm: bool) -> None:
        if self.uses_driver:
            self._serve("arm", SetBool, arm)

    @override
    def set_group_mask(self, group_mask: int) -> None:
        self.groups = group_mask

    @property
    def groups(self) -> int:
        """Mask of the groups that the script has made it a member of."""
        return self._groups

    @groups.setter
    def groups(self, mask: int) -> None:
        self._serve("set_group_mask", srv.SetGroupMask, mask)
        self._groups = mask

    @override
    def upload_trajectory(
        self, trajectory_id: int, piece_offset: int, pieces: Sequence[PolynomialPiece]
    ) -> None:
        messages = [to_message(piece) for piece in pieces]
        for message in messages:
            if any(message.poly_yaw):
                message.poly_yaw = [self.checked_yaw(value) for value in message.poly_yaw]
        arguments = (trajectory_id, piece_offset, messages)
        self._serve("upload_trajectory", srv.UploadTrajectory, *arguments)

    @override
    def send(self, setpoint: Setpoint) -> None:
        self.note_flight()
        self._setpoints.publish(self.held.passed(setpoint))

    def call(self, service: str, service_type: Any, *arguments: Any) -> "Future[Any]":
        """Call a service; return the future of the answer."""
        return self._vehicle.call(service, service_type, *arguments)

    def checked_yaw(self, yaw: float) -> float:
        """Return a yaw that the vehicle can have, rad; another is refused."""
        if yaw == 0.0 or self._vehicle.has_yaw:
            return yaw
        self._connection.refuse(
            f"{self.name}: a yaw of {yaw:.3g}: its controller keeps the heading 0; expected 0"
        )
        return 0.0

    def _serve(self, service, service_type, *arguments):
        self._command(service, self.call(service, service_type, *arguments))

    def _command(self, what, call):
        self.held.end_setpoints()
        self._connection.finish(what, {self.name: call})

    def _check(self, what, goal):
        """Refuse a goal (m) that is out of the fence of the vehicle, or below the ground."""
        bounds = self._vehicle.bounds
        for value, low, high, axis in zip(goal, bounds.lower, bounds.upper, "xyz", strict=True):
            if not low <= value <= high:
                self._connection.refuse(
                    f"{self.name}: {what}: {axis} is {value:.3g} m, out of the fence; expected "
                    f"{low:g} to {high:g} m"
                )

    # End of the flight.

    def note_flight(self) -> None:
        """Note that the vehicle is landed at the end of the script."""
        self.held.is_landing = False
        self._connection.fleet.adopt(self.name)

    def note_landing(self, group_mask: int) -> None:
        """Note that the script has vehicles of groups land."""
        self.held.is_landing = self.held.is_landing or self.is_member(group_mask)

    @property
    def uses_driver(self) -> bool:
        """Whether the driver flies it, and no controller of the workspace."""
        return self._vehicle.uses_driver

    def has_begun(self) -> bool:
        """Return whether a takeoff under the workspace's controller is under way."""
        status = self._vehicle.flight_status.state
        return status in (FlightStatus.TAKING_OFF, FlightStatus.FLYING)

    def has_landed(self) -> bool:
        """Return whether it is on the ground with its motors off."""
        return self._vehicle.has_landed()

    # Firmware parameters.

    @override
    def set_parameters(self, values: Mapping[str, float]) -> None:
        if self._parameters is not None:
            self._parameters.update(values)
            return
        for name in values:
            self.get_parameter(name)
        paths = {key.replace(".", "/"): value for key, value in values.items()}
        for path, value in paths.items():
            self._connection.handle.set_param(f"/{self.name}/{path}", value)
        call = self.call("update_params", srv.UpdateParams, [*paths])
        self._connection.finish("update_params", {self.name: call})

    @override
    def get_parameter(self, name: str) -> float:
        if self._parameters is not None:
            return self._parameters[name]
        path = f"/{self.name}/{name.replace('.', '/')}"
        try:
            value: float = self._connection.handle.get_param(path, FirmwareNumber())
        except ParameterError:
            raise ValueError(
                f"{self.name}: the firmware has no parameter {name}, as the driver has not set "
                f"{path}; expected one that `rosparam list /{self.name}` prints"
            ) from None
        return value

    @override
    def enable_avoidance(
        self, others: Sequence[VehicleBackend], settings: AvoidanceSettings
    ) -> None:
        if not self.uses_driver:
            self._connection.handle.warn(
                f"{self.name}: enableCollisionAvoidance has no effect: the fleet keeps vehicles "
                "that its controllers fly apart, by the buffers of the fleet file"
            )
            return
        try:
            self.set_parameters({**avoidance_parameters(settings), "colAv.enable": 1})
            self.held.avoids = True
        except ValueError as error:
            self._connection.refuse(f"{self.name}: enableCollisionAvoidance: {error}")

    @override
    def disable_avoidance(self) -> None:
        if self.uses_driver:
            self.set_parameters({"colAv.enable": 0})
            self.held.avoids = False

    # State.

    @override
    def state(self) -> VehicleState:
        return self._states.state()

    @override
    def status(self) -> dict[str, Any]:
        status = self._vehicle.driver_status
        supervisor, battery = status.supervisor, status.battery_voltage
        if not self.uses_driver:
            is_flying = self._vehicle.flight_status.state not in _NOT_FLYING
            ready = VehicleStatus.CAN_BE_ARMED | VehicleStatus.ARMED | VehicleStatus.CAN_FLY
            supervisor, battery = ready | is_flying * VehicleStatus.FLYING, math.nan
        names = ("num_rx_broadcast", "num_tx_broadcast", "num_rx_unicast", "num_tx_unicast")
        return {
            "id": self.name,
            "timestamp_sec": status.header.stamp.secs,
            "timestamp_nsec": status.header.stamp.nsecs,
            "supervisor": supervisor,
            "battery": battery,
            "pm_state": getattr(status, "pm_state", 0),
            "rssi": status.rssi,
            "latency_unicast": round(1e3 * status.latency) if status.latency > 0.0 else 0,
            **{name: getattr(status, name, 0) for name in names},
        }
