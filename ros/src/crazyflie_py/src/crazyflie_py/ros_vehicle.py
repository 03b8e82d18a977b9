"""A vehicle of Crazyswarm's API by ROS: behind the driver, or under the workspace's controller."""

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from typing import Any

import genpy
from geometry_msgs.msg import Point
from std_srvs.srv import SetBool
from typing_extensions import override

from crazyflie_driver import srv
from crazyflie_fleet.conversions import to_message
from crazyflie_mission_api.ros_vehicle import Pose, RosVehicle
from crazyflie_model.angles import Triple, rpy_from_quaternion
from crazyflie_model.collision_avoidance import AvoidanceSettings
from crazyflie_model.polynomials import PolynomialPiece
from crazyflie_msgs.msg import FlightStatus, VehicleStatus
from crazyflie_py.avoidance_parameters import avoidance_parameters
from crazyflie_py.backend import VehicleBackend, VehicleState
from crazyflie_py.ros_connection import Connection
from crazyflie_py.ros_setpoints import SetpointPublishers
from crazyflie_py.setpoints import Setpoint
from crazyflie_utils import ParameterError
from crazyflie_utils.parameters.types import FINITE

_log = logging.getLogger(__name__)

_STATE_TIMEOUT = 10.0
"""For a state, s of the vehicles' time."""

_VELOCITY_SPAN = 0.2
"""Longest time between two poses from which a velocity follows, s."""

_NOT_FLYING = (FlightStatus.UNKNOWN, FlightStatus.ON_GROUND)

_UNKNOWN: Triple = (math.nan, math.nan, math.nan)


class RosVehicleBackend(VehicleBackend):
    """One vehicle; see `crazyflie_py.backend.VehicleBackend`."""

    def __init__(
        self, vehicle: RosVehicle, vehicle_id: int, position: Triple | None, connection: Connection
    ):
        self.name = vehicle.name
        self.id = vehicle_id
        self._vehicle = vehicle
        self._connection = connection
        self._setpoints = SetpointPublishers(connection.handle, vehicle)
        self._last_pose: Pose | None = None
        self._velocity = _UNKNOWN
        self._is_landing = False
        self._groups = 0
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
        x, y, _ = self._vehicle.position() or self.initial_position
        self._check("takeoff", (x, y, height))
        self.note_flight()
        return self._vehicle.take_off(height, duration, group_mask)

    @override
    def land(self, height: float, duration: float, group_mask: int) -> None:
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
        self._connection.finish("emergency", {self.name: self._vehicle.emergency()})

    @override
    def arm(self, arm: bool) -> None:
        if self._vehicle.uses_driver:
            self._command("arm", SetBool, arm)

    @override
    def set_group_mask(self, group_mask: int) -> None:
        self._command("set_group_mask", srv.SetGroupMask, group_mask)
        self._groups = group_mask

    @override
    def upload_trajectory(
        self, trajectory_id: int, piece_offset: int, pieces: Sequence[PolynomialPiece]
    ) -> None:
        messages = [to_message(piece) for piece in pieces]
        arguments = (trajectory_id, piece_offset, messages)
        self._command("upload_trajectory", srv.UploadTrajectory, *arguments)

    @override
    def send(self, setpoint: Setpoint) -> None:
        self.note_flight()
        self._setpoints.publish(setpoint)

    def call(self, service: str, service_type: Any, *arguments: Any) -> "Future[Any]":
        """Call a service; return the future of the answer."""
        return self._vehicle.call(service, service_type, *arguments)

    def _command(self, service, service_type, *arguments):
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
        self._is_landing = False
        self._connection.fleet.adopt(self.name)

    def note_landing(self, group_mask: int) -> None:
        """Note that the script has vehicles of groups land."""
        self._is_landing = self._is_landing or group_mask == 0 or bool(group_mask & self._groups)

    @property
    def is_landing(self) -> bool:
        """Whether the script has it land."""
        return self._is_landing

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
        paths = {key.replace(".", "/"): value for key, value in values.items()}
        for path in paths:
            self.get_parameter(path.replace("/", "."))
        for path, value in paths.items():
            self._connection.handle.set_param(f"/{self.name}/{path}", value)
        self._command("update_params", srv.UpdateParams, list(paths))

    @override
    def get_parameter(self, name: str) -> float:
        if not self._vehicle.uses_driver:
            raise ValueError(
                f"{self.name}: there is no firmware parameter {name}: a simulated vehicle has no "
                "firmware; expected a virtual or real one, or --sim"
            )
        path = f"/{self.name}/{name.replace('.', '/')}"
        try:
            value: float = self._connection.handle.get_param(path, FINITE)
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
        if not self._vehicle.uses_driver:
            _log.warning(
                "%s: enableCollisionAvoidance: the fleet keeps simulated vehicles apart by their "
                "buffers; the ellipsoid has no effect",
                self.name,
            )
            return
        self.set_parameters({**avoidance_parameters(settings), "colAv.enable": 1})

    @override
    def disable_avoidance(self) -> None:
        if self._vehicle.uses_driver:
            self.set_parameters({"colAv.enable": 0})

    # State.

    @override
    def state(self) -> VehicleState:
        pose = self._wait_for(lambda: True)
        previous, self._last_pose = self._last_pose, pose
        if previous is None or not 0.0 < pose.time - previous.time < _VELOCITY_SPAN:
            if previous is None or pose.time != previous.time:
                previous = pose
                pose = self._wait_for(lambda: self._time() > previous.time)
                self._last_pose = pose
        if previous is not pose and pose.time > previous.time:
            span = pose.time - previous.time
            change = zip(pose.position, previous.position, strict=True)
            vx, vy, vz = ((after - before) / span for after, before in change)
            self._velocity = vx, vy, vz
        rpy = rpy_from_quaternion(*pose.rotation)
        return VehicleState(pose.position, self._velocity, _UNKNOWN, rpy)

    def _time(self):
        pose = self._vehicle.pose()
        return -math.inf if pose is None else pose.time

    def _wait_for(self, condition: Callable[[], bool]) -> Pose:
        clock = self._connection.fleet.clock
        if self._vehicle.pose() is None or not condition():
            clock.wait_until(
                lambda: self._vehicle.pose() is not None and condition(),
                clock.time() + _STATE_TIMEOUT,
            )
        pose = self._vehicle.pose()
        if pose is None:
            raise TimeoutError(
                f"{self.name}: no position for {_STATE_TIMEOUT:g} s; does motion capture track it?"
            )
        return pose

    @override
    def status(self) -> dict[str, Any]:
        status = self._vehicle.driver_status
        supervisor, battery = status.supervisor, status.battery_voltage
        if not self._vehicle.uses_driver:
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


def seconds(duration: float) -> genpy.Duration:
    """Return a duration, s, as ROS has it."""
    return genpy.Duration.from_sec(duration)
