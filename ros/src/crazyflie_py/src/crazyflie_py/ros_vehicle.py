"""A vehicle of Crazyswarm's API by ROS: behind the driver, or under the workspace's controller."""

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from typing import Any

from geometry_msgs.msg import Point
from std_srvs.srv import SetBool
from typing_extensions import override

from crazyflie_driver import srv
from crazyflie_fleet.conversions import to_message
from crazyflie_fleet.settings import FirmwareNumber
from crazyflie_mission_api.ros_vehicle import RosVehicle, seconds
from crazyflie_model.angles import Triple
from crazyflie_model.collision_avoidance import AvoidanceSettings
from crazyflie_model.polynomials import PolynomialPiece
from crazyflie_msgs.msg import FlightStatus, VehicleStatus
from crazyflie_py.avoidance_parameters import avoidance_parameters
from crazyflie_py.backend import VehicleBackend, VehicleState
from crazyflie_py.held_vehicle import HeldVehicle
from crazyflie_py.ros_connection import Connection
from crazyflie_py.ros_setpoints import SetpointPublishers
from crazyflie_py.ros_states import RosStates
from crazyflie_py.setpoints import Setpoint
from crazyflie_py.simulated_parameters import SimulatedParameters
from crazyflie_utils import ParameterError

_NOT_FLYING = (FlightStatus.UNKNOWN, FlightStatus.ON_GROUND)


class RosVehicleBackend(VehicleBackend):
    """One vehicle; see `crazyflie_py.backend.VehicleBackend`."""

    def __init__(
        self,
        vehicle: RosVehicle,
        vehicle_id: int,
        position: Triple | None,
        connection: Connection,
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
    def take_off(self, height: float, duration: float, group_mask: int) -> None:
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
    def land(self, height: float, duration: float, group_mask: int) -> None:
        self.held.free(duration)
        self._command("land", srv.Land, group_mask, height, seconds(duration))
        self.note_landing(group_mask)

    @override
    def stop(self, group_mask: int) -> None:
        self._command("stop", srv.Stop, group_mask)

    @override
    def go_to(
        self, goal: Triple, yaw: float, duration: float, relative: bool, group_mask: int
    ) -> None:
        if not relative:
            self._check("goTo", goal)
        self.note_flight()
        yaw = self.checked_yaw(yaw)
        arguments = (group_mask, relative, Point(*goal), yaw, seconds(duration))
        self._command("go_to", srv.GoTo, *arguments)

    @override
    def start_trajectory(
        self, trajectory_id: int, time_scale: float, reverse: bool, relative: bool, group_mask: int
    ) -> None:
        self.note_flight()
        arguments = (group_mask, trajectory_id, time_scale, reverse, relative)
        self._command("start_trajectory", srv.StartTrajectory, *arguments)

    @override
    def notify_setpoints_stop(self, remain_valid_ms: int, group_mask: int) -> None:
        self._command("notify_setpoints_stop", srv.NotifySetpointsStop, group_mask, remain_valid_ms)

    @override
    def emergency(self) -> None:
        self._connection.finish("emergency", {self.name: self.begin_emergency()})

    def begin_emergency(self) -> "Future[Any]":
        """Stop the motors; the future is done when the answer has come."""
        return self._vehicle.emergency()

    @override
    def arm(self, arm: bool) -> None:
        if self.uses_driver:
            self._command("arm", SetBool, arm)

    @override
    def set_group_mask(self, group_mask: int) -> None:
        self.groups = group_mask

    @property
    def groups(self) -> int:
        """Mask of the groups that the script has made it a member of."""
        return self._groups

    @groups.setter
    def groups(self, mask: int) -> None:
        self._command("set_group_mask", srv.SetGroupMask, mask)
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
        self._command("upload_trajectory", srv.UploadTrajectory, *arguments)

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

    def _command(self, service, service_type, *arguments):
        self.held.end_setpoints()
        call = self.call(service, service_type, *arguments)
        self._connection.finish(service, {self.name: call})

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
