"""Vehicles of a mission, reached over ROS."""

import math
from collections import deque
from collections.abc import Collection, Mapping
from concurrent.futures import Future
from functools import partial
from typing import Any, NamedTuple

import genpy
from geometry_msgs.msg import Point, PoseStamped
from std_msgs.msg import ColorRGBA
from std_srvs.srv import Empty, EmptyRequest, SetBool
from typing_extensions import override

from crazyflie_driver import srv
from crazyflie_driver.trajectory_messages import to_message
from crazyflie_fleet.high_level_services import (
    HIGH_LEVEL,
    TAKEOFF_LEAD,
    heading,
)
from crazyflie_mission_api.limits import EVERYWHERE, Bounds
from crazyflie_mission_api.mission_vehicle import (
    MEMORY,
    AttitudeSetpoint,
    Commands,
    MissionVehicle,
    Move,
    Playback,
    Setpoint,
    done,
)
from crazyflie_mission_api.stream import SetpointPublishers, SetpointStream
from crazyflie_mission_api.trajectories import START_SKEW
from crazyflie_model.angles import Triple, quaternion_from_rpy
from crazyflie_model.supervisor import SupervisorState
from crazyflie_model.trajectory import Pieces
from crazyflie_msgs.msg import FlightStatus, PositionVelocityYawStateStamped, VehicleStatus
from crazyflie_takeoff.motion import MAX_POSITION_AGE
from crazyflie_utils import NodeHandle, ServiceError, TransformError
from crazyflie_utils.flight_status import WORDS, in_flight_of
from crazyflie_utils.parameters.types import FINITE
from crazyflie_utils.steps import follow
from crazyflie_utils.tf.transforms import MAX_FUTURE_STAMP_SIMULATED

_AGE_PERIOD = 0.1  #: Period at which the two clocks are compared (s of the machine's clock).
_LANDED_HEIGHT = 0.1  #: Largest height above the start of a vehicle that has landed (m).
#: States of the takeoff server after the flight.
_ENDED = (FlightStatus.ON_GROUND, FlightStatus.LANDING, FlightStatus.DESCENDING)

ALL_OF_FLEET = f"/all/{HIGH_LEVEL}"  #: Namespace of a fleet's services for all.
CALL_TIMEOUT = 60.0  #: Timeout of a service (s of the machine's clock).
_SETTLING_TIME = 0.5  #: Time after the planned end of a landing until the vehicle is down (s).
_HIGH_LEVEL = "commander/enHighLevel"  #: The firmware parameter that enables high-level commands.
#: Duration of the go_to to the vehicle's place at the end of a stream, or of a trajectory (s).
_HOLD_DURATION = 0.5
#: Timeout of the answer to that go_to (s of the machine's clock); the driver's is 1 s.
_HOLD_TIMEOUT = 3.0

#: Time for which a landing is retried while setpoints are streamed (s): without an answer they
#: would end with the mission, and the vehicle would fall.
_LANDING_RETRY_TIME = 10.0


class TimedPose(NamedTuple):
    """Position (m), rotation (quaternion x, y, z, w) and their time (s)."""

    position: Triple
    rotation: tuple[float, float, float, float]
    time: float


def velocity_between(first: TimedPose, last: TimedPose) -> Triple:
    """Return the mean velocity, m/s, from one pose to a later one."""
    span = last.time - first.time
    x, y, z = ((b - a) / span for a, b in zip(first.position, last.position, strict=True))
    return x, y, z


class Access(NamedTuple):
    """How a vehicle is seen and flown."""

    top: str  #: Namespace of its high-level services.
    uses_driver: bool
    #: The fixed and its own frame, if its position comes by tf; with the driver only as long as
    #: there are no poses.
    frames: tuple[str, str] | None
    has_yaw: bool  #: Whether it can have another heading than 0.


class PoseAgeLimit:
    """Age up to which a pose is that of its vehicle: 0.5 s of the vehicles' or the machine's clock.

    Simulated time may run faster than a message arrives: /clock comes by another connection.
    """

    def __init__(self, handle: NodeHandle):
        self._handle = handle
        # Simulated time at the last ticks of the machine's clock, s.
        self._times: deque[float] = deque(maxlen=round(MAX_POSITION_AGE / _AGE_PERIOD))
        if handle.uses_sim_time:
            handle.timer(_AGE_PERIOD, self._tick, steady=True)

    def __call__(self) -> float:
        """Return the limit, s of the vehicles' clock."""
        moved = self._handle.time() - self._times[0] if self._times else 0.0
        return max(MAX_POSITION_AGE, moved)

    def _tick(self):
        self._times.append(self._handle.time())


class RosVehicleState:
    """Pose of a vehicle, whether it can fly on, and whether it has landed.

    The driver publishes its pose and status; otherwise the takeoff server its status, and an
    estimator its state.
    """

    def __init__(self, name: str, handle: NodeHandle, access: Access, max_age: PoseAgeLimit):
        self._max_age = max_age
        _, uses_driver, frames, has_yaw = access
        self.name = name
        self._handle = handle
        self.uses_driver = uses_driver
        self.has_yaw = has_yaw
        #: flight_status, driver_status: The last messages.
        self.flight_status = FlightStatus()
        self.driver_status = VehicleStatus(link=VehicleStatus.CONNECTING)
        self._pose: TimedPose | None = None
        self._seen_at = -math.inf
        # Height of the ground at the last takeoff (m), and planned end of the last landing (s).
        self._ground = 0.0
        self._landing_end = 0.0
        top = prefix(name)
        self._lookup = None if frames is None else partial(handle.listen_to_poses(), *frames)
        if uses_driver:
            handle.subscribe(f"{top}/pose", PoseStamped, self._on_pose, finite="pose")
            handle.subscribe(f"{top}/vehicle_status", VehicleStatus, self._on_driver_status)
            return
        if frames is None:
            state = PositionVelocityYawStateStamped
            handle.subscribe(f"{top}/state", state, self._on_state, finite="state")
        topic = f"{in_flight_of(handle, top)}_flight_status"
        handle.subscribe(topic, FlightStatus, self._on_flight_status)

    def position(self) -> Triple | None:
        """Return the position, m; None when it is not known."""
        pose = self.pose()
        return None if pose is None else pose.position

    def heading(self) -> float:
        """Return the heading, rad; 0 when it is not known, or cannot change."""
        pose = self.pose() if self.has_yaw else None
        return 0.0 if pose is None else heading(*pose.rotation)

    def pose(self) -> TimedPose | None:
        """Return the pose of the vehicle; None if it is not known."""
        max_age = self._max_age()
        if self._handle.time() - self._seen_at < max_age:
            return self._pose
        if self._lookup is None:
            return None
        try:
            pose = self._lookup()
        except TransformError:
            return None
        # tf keeps the last pose of a vehicle that is not tracked any more.
        age = (self._handle.nanoseconds() - pose.stamp) * 1e-9
        # A pose far ahead of now is from before the clock was set back.
        if not -MAX_FUTURE_STAMP_SIMULATED <= age < max_age:
            return None
        return TimedPose(pose.position, pose.rotation, pose.stamp * 1e-9)

    def fault(self) -> str:
        """Return why the vehicle cannot fly on; empty if it can."""
        if self.uses_driver:
            status = self.driver_status
            cannot_fly_on = (
                status.link in (VehicleStatus.LOST, VehicleStatus.DISCONNECTED)
                or status.is_emergency
                or SupervisorState(status.supervisor).faults
                # The driver lands it.
                or status.battery == VehicleStatus.BATTERY_CRITICAL
            )
            return status.text if cannot_fly_on else ""
        flight = self.flight_status
        if flight.state in _ENDED:
            return f"it does not fly any more: {flight.reason or WORDS[flight.state]}"
        return ""

    def has_landed(self) -> bool:
        """Return whether the vehicle is on the ground, with its motors off."""
        if not self.uses_driver:
            return self.flight_status.state == FlightStatus.ON_GROUND
        status, place = self.driver_status, self.position()
        if status.link == VehicleStatus.CONNECTED and status.has_supervisor:
            # The floor may be lower than where the vehicle took off; the driver ends the landing.
            state = SupervisorState(status.supervisor)
            is_flying = SupervisorState.FLYING in state or state.faults or status.is_emergency
            is_down = not is_flying
        else:
            is_down = place is not None and place[2] < self._ground + _LANDED_HEIGHT
        # Then the mission stops the motors, which must not happen in the last centimetres.
        return is_down and self._handle.time() >= self._landing_end

    def _on_pose(self, message):
        p, q = message.pose.position, message.pose.orientation
        self._seen_at = self._handle.time()
        self._pose = TimedPose((p.x, p.y, p.z), (q.x, q.y, q.z, q.w), self._seen_at)

    def _on_state(self, message):
        s = message.state
        self._seen_at = self._handle.time()
        rotation = quaternion_from_rpy(0.0, 0.0, s.yaw)
        self._pose = TimedPose((s.x, s.y, s.z), rotation, self._seen_at)

    def _on_flight_status(self, message):
        self.flight_status = message

    def _on_driver_status(self, message):
        self.driver_status = message


def prefix(name: str) -> str:
    """Return the namespace of a vehicle; that of "/" is the root."""
    return "" if name == "/" else f"/{name}"


def flown_vehicles(services: Mapping[str, str]) -> dict[str, str]:
    """Return the vehicles with services for high-level commands: name to the driver's node.

    It is empty for a vehicle of a `HighLevelNode`. ``services`` are the names of all, to the nodes
    that offer them.
    """
    found = {}
    for service, node in services.items():
        top, _, last = service.rpartition("/")
        above, _, own = top.rpartition("/")
        if own == HIGH_LEVEL and last == "go_to":
            found[above] = ""
        elif own != HIGH_LEVEL and last == "upload_trajectory":
            if services.get(f"{top}/takeoff") == node:
                found.setdefault(top, node)
    return {top.strip("/") or "/": node for top, node in found.items() if top != "/all"}


def common_services(services: Mapping[str, str], names: Collection[str]) -> str | None:
    """Return the namespace of services for exactly these vehicles, if there is one.

    ``services`` are as for `flown_vehicles`.
    """
    nodes = flown_vehicles(services)
    if "" in nodes.values():
        nodes = {name: node for name, node in nodes.items() if not node}
    if {*nodes} != {*names} or len({*nodes.values()}) > 1:
        return None
    (node,) = {*nodes.values()}
    top = f"{node}/all" if node else ALL_OF_FLEET
    return top if f"{top}/go_to" in services else None


class ServiceCommands(Commands):
    """Commands by services below ``top``, of which ``emergency`` may be elsewhere."""

    def __init__(self, handle: NodeHandle, top: str, emergency: str | None = None):
        self._handle = handle
        self.top = top
        self._emergency = emergency or f"{top}/emergency"

    @override
    def takeoff(self, height: float, duration: float, group_mask: int = 0) -> "Future[Any]":
        return self.call("takeoff", srv.Takeoff, group_mask, height, seconds(duration))

    @override
    def land(self, height: float | None, duration: float, group_mask: int = 0) -> "Future[Any]":
        return self.call("land", srv.Land, group_mask, height or 0.0, seconds(duration))

    @override
    def stop(self, group_mask: int = 0) -> "Future[Any]":
        return self.call("stop", srv.Stop, group_mask)

    @override
    def go_to(self, move: Move, group_mask: int = 0) -> "Future[Any]":
        return self.call("go_to", srv.GoTo, *_numbers(move, group_mask))

    @override
    def start_trajectory(self, flight: Playback, group_mask: int = 0) -> "Future[Any]":
        return self.call("start_trajectory", srv.StartTrajectory, group_mask, *flight)

    @override
    def notify_setpoints_stop(self, remain_valid_ms: int, group_mask: int = 0) -> "Future[Any]":
        arguments = (group_mask, remain_valid_ms)
        return self.call("notify_setpoints_stop", srv.NotifySetpointsStop, *arguments)

    @override
    def emergency(self) -> "Future[Any]":
        request = EmptyRequest()
        return self._handle.call_service(self._emergency, Empty, request, CALL_TIMEOUT)

    def call(
        self, name: str, service_type: Any, *arguments: Any, limit: float = CALL_TIMEOUT
    ) -> "Future[Any]":
        """Call a service below `top`; ``limit`` is in s of the machine's clock."""
        request = service_type._request_class(*arguments)
        return self._handle.call_service(f"{self.top}/{name}", service_type, request, limit)


class RosVehicle(RosVehicleState, ServiceCommands, MissionVehicle):
    """A vehicle by the services of the driver, or by those of `HighLevelNode`, below ``top``."""

    def __init__(self, name: str, handle: NodeHandle, access: Access, max_age: PoseAgeLimit):
        RosVehicleState.__init__(self, name, handle, access, max_age)
        ServiceCommands.__init__(self, handle, access.top)
        self.bounds = fence(handle, prefix(name))
        self.start_skew = START_SKEW if access.uses_driver else 0.0
        self.takeoff_lead = 0.0 if access.uses_driver else TAKEOFF_LEAD
        self._stream: SetpointStream | None = None
        self._prepared: Pieces | None = None
        self._has_uploaded = False
        self._setpoints = SetpointPublishers(handle, access.top)
        if access.uses_driver:
            frame = "" if access.frames is None else access.frames[0]
            self._stream = SetpointStream(
                handle, f"{prefix(name)}/cmd_full_state", frame, self._hold
            )

    @override
    def fault(self) -> str:
        return super().fault() or ("" if self._stream is None else self._stream.fault)

    @property
    def is_streamed(self) -> bool:
        """Whether there are setpoints, or `start` begins to send them."""
        return self._prepared is not None or (self._stream is not None and self._stream.is_active)

    # Commands.

    @override
    def takeoff(self, height: float, duration: float, group_mask: int = 0) -> "Future[Any]":
        place = self.position()
        self._ground = 0.0 if place is None else place[2]

        def calls():
            if self.uses_driver:
                # This call waits until the driver has read the parameters, which it sets then.
                yield self.call("update_params", srv.UpdateParams, [])
                yield self._handle.set_param_later(f"{prefix(self.name)}/{_HIGH_LEVEL}", 1)
                yield self.call("update_params", srv.UpdateParams, [_HIGH_LEVEL])
            return (yield super(RosVehicle, self).takeoff(height, duration, group_mask))

        return follow(calls())

    @override
    def land(self, height: float | None, duration: float, group_mask: int = 0) -> "Future[Any]":
        self._landing_end = self._handle.time() + duration + _SETTLING_TIME
        end = self._ground if height is None else height
        land = super().land
        return self._hand_over(lambda: land(end, duration, group_mask), _LANDING_RETRY_TIME)

    @override
    def go_to(self, move: Move, group_mask: int = 0) -> "Future[Any]":
        go_to = super().go_to
        return self._hand_over(lambda: go_to(move, group_mask))

    @override
    def prepare(self, pieces: Pieces, stream: bool) -> "Future[Any]":
        self._prepared = pieces if stream and self.uses_driver else None
        if self._prepared is not None:
            return done(None)
        if self.uses_driver and len(pieces) > MEMORY:
            return done(
                ServiceError(
                    f"the trajectory has {len(pieces)} pieces; expected at most {MEMORY}, which is "
                    "what the vehicle's memory holds, or stream=True"
                )
            )
        return follow(self._upload(pieces))

    def _upload(self, pieces):
        if self.uses_driver and self._has_uploaded and not self.has_landed():
            # The vehicle may be at the end of the last one, which it holds as long as that is in
            # the memory: it holds a goal instead.
            yield self.go_to(Move((0.0, 0.0, 0.0), 0.0, _HOLD_DURATION, relative=True))
        self._has_uploaded = True
        return (yield self.upload_trajectory(0, 0, pieces))

    @override
    def start(self) -> "Future[Any]":
        if self._prepared is not None and self._stream is not None:
            return self._stream.start(self._prepared)
        return self._hand_over(lambda: self.start_trajectory(Playback(0)))

    @override
    def upload_trajectory(
        self, trajectory_id: int, piece_offset: int, pieces: Pieces
    ) -> "Future[Any]":
        arguments = (trajectory_id, piece_offset, [to_message(piece) for piece in pieces])
        return self.call("upload_trajectory", srv.UploadTrajectory, *arguments)

    @override
    def set_group_mask(self, group_mask: int) -> "Future[Any]":
        return self.call("set_group_mask", srv.SetGroupMask, group_mask)

    @override
    def arm(self, arm: bool) -> "Future[Any]":
        return self.call("arm", SetBool, arm) if self.uses_driver else done(None)

    @override
    def set_led_color(self, red: float, green: float, blue: float) -> "Future[Any]":
        # The driver's service, also of a vehicle that a controller flies.
        service = f"{prefix(self.name)}/set_led_color"
        if service not in self._handle.service_nodes():
            return done(None)
        request = srv.SetLedColorRequest(ColorRGBA(red, green, blue, 0.0))
        return self._handle.call_service(service, srv.SetLedColor, request, CALL_TIMEOUT)

    @override
    def send(self, setpoint: Setpoint) -> None:
        if isinstance(setpoint, AttitudeSetpoint) and not self.uses_driver:
            raise ValueError(
                f"{self.name}: cmdVel cannot be followed: a controller of the workspace flies it; "
                "expected cmdPosition, cmdFullState, cmdVelocityWorld or cmdHover"
            )
        self._setpoints.publish(setpoint)

    @override
    def emergency(self) -> "Future[Any]":
        if self._stream is not None:
            self._stream.stop()
        return super().emergency()

    def _hand_over(self, send, retry_time=0.0):
        return send() if self._stream is None else self._stream.hand_over(send, retry_time)

    def _hold(self, goal):
        move = _numbers(Move(goal.position, goal.yaw, _HOLD_DURATION), 0)
        return self.call("go_to", srv.GoTo, *move, limit=_HOLD_TIMEOUT)


def _numbers(move, group_mask):
    """Return the fields of the request of go_to."""
    return group_mask, move.relative, Point(*move.goal), move.yaw, seconds(move.duration)


def fence(handle: NodeHandle, top: str) -> Bounds:
    """Return the box of a vehicle's geofence, if it has one."""
    corners = [
        [handle.get_param(f"{top}/geofence/box/{side}/{axis}", FINITE, None) for axis in "xyz"]
        for side in ("min", "max")
    ]
    if None in corners[0] + corners[1]:
        return EVERYWHERE
    return Bounds((corners[0][0], corners[0][1], corners[0][2]), tuple(corners[1]))


def seconds(duration: float) -> genpy.Duration:
    """Return a duration, s, as a ROS duration."""
    return genpy.Duration.from_sec(duration)
