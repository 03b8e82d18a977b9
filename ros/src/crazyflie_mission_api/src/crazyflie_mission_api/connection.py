"""Vehicles as a team needs them, by ROS."""

import math
from concurrent.futures import Future
from functools import partial
from typing import Any

import genpy
from geometry_msgs.msg import Point, PoseStamped
from std_msgs.msg import String
from std_srvs.srv import Empty, EmptyRequest

from crazyflie_driver import srv
from crazyflie_mission_api.conversions import heading, to_message
from crazyflie_mission_api.course import START_SKEW
from crazyflie_mission_api.futures import done, in_turn
from crazyflie_mission_api.limits import EVERYWHERE, Bounds
from crazyflie_mission_api.starter import Starter
from crazyflie_mission_api.stream import SetpointStream
from crazyflie_mission_api.trajectories import Pieces
from crazyflie_model.angles import Triple
from crazyflie_msgs.msg import PositionVelocityYawStateStamped, VehicleStatus
from crazyflie_utils import NodeHandle, ServiceError, TransformError
from crazyflie_utils.parameters.types import FINITE

CALL_LIMIT = 60.0
"""How long a service may take, s of the machine's clock."""

MEMORY = 31
"""Pieces that the memory of a vehicle holds."""

MAX_POSITION_AGE = 0.5
"""A position older than this is not known, s; as `high_level_node.STATE_LIMIT`."""

_ON_GROUND = 0.1
"""Height above where it stood at which a vehicle has landed, m."""

_FAULTS = VehicleStatus.TUMBLED | VehicleStatus.LOCKED | VehicleStatus.CRASHED
"""States of the supervisor in which a vehicle cannot fly."""

_SETTLING = 0.5
"""After a landing should be at its end, s."""

_HIGH_LEVEL = "commander/enHighLevel"
"""The parameter of a vehicle that has it take high-level commands."""

_HOLD_DURATION = 0.5
"""Of the go_to at the end of a stream, to where the vehicle is, s."""

_HOLD_LIMIT = 3.0
"""How long it may take to be answered, s of the machine's clock; the driver's own limit is 1 s."""

_LANDING_RETRY_TIME = 10.0
"""How long a vehicle that is streamed to is told to land, s: without an answer setpoints would end
with the mission, and the vehicle would fall."""


class RosVehicle:
    """A vehicle by the services of the driver, or by those of `HighLevelNode`.

    Parameters
    ----------
    name : str
    handle : NodeHandle
    services : dict of str to str
        Where its services are: go_to, takeoff and so on to absolute names.
    starter : Starter, optional
        Of those that a controller flies, and not the driver.
    frames : tuple of str, optional
        The fixed frame and its own, if tf says where it is; with the driver only as long as
        there are no poses.
    has_yaw : bool
        Whether it can have another heading than 0.
    """

    def __init__(
        self,
        name: str,
        handle: NodeHandle,
        services: dict[str, str],
        starter: Starter | None = None,
        frames: tuple[str, str] | None = None,
        has_yaw: bool = True,
    ):
        self.name = name
        self.bounds = fence(handle, prefix(name))
        self._handle = handle
        self._services = services
        self._starter = starter
        self._is_driven = is_driven = starter is None
        self._has_yaw = has_yaw
        # Position and heading.
        self._pose: tuple[Triple, float] | None = None
        self._seen_at = -math.inf
        self._ground = 0.0
        self._landing_end = 0.0
        self._status = ""
        self._driver_status = VehicleStatus(link=VehicleStatus.CONNECTING)
        self._flight_state = ""
        self._stream: SetpointStream | None = None
        self._prepared: Pieces | None = None
        top = prefix(name)
        self._lookup = None if frames is None else partial(handle.listen_to_poses(), *frames)
        if is_driven:
            handle.subscribe(f"{top}/pose", PoseStamped, self._on_pose, finite="pose")
            handle.subscribe(f"{top}/vehicle_status", VehicleStatus, self._on_driver_status)
            frame = "" if frames is None else frames[0]
            self._stream = SetpointStream(handle, f"{top}/cmd_full_state", frame, self._hold)
        else:
            if frames is None:
                state = PositionVelocityYawStateStamped
                handle.subscribe(f"{top}/state", state, self._on_state, finite="state")
            handle.subscribe(f"{top}/in_flight_state", String, self._on_flight_state)
            handle.subscribe(f"{top}/in_flight_status", String, self._on_status)

    @property
    def start_skew(self) -> float:
        """How much later than others that are told to `start` in a row it may begin, s."""
        return 0.0 if self._starter is not None else START_SKEW

    # Where it is, and how it is.

    def position(self) -> Triple | None:
        """Return where it is, m; None when that is not known for `MAX_POSITION_AGE`."""
        pose = self._latest_pose()
        return None if pose is None else pose[0]

    def heading(self) -> float:
        """Return its heading, rad; 0 when that is not known, or never another."""
        pose = self._latest_pose() if self._has_yaw else None
        return 0.0 if pose is None else pose[1]

    def _latest_pose(self):
        if self._handle.time() - self._seen_at < MAX_POSITION_AGE:
            return self._pose
        if self._lookup is None:
            return None
        try:
            pose = self._lookup()
        except TransformError:
            return None
        # tf keeps the last pose of a vehicle that is not tracked any more.
        age = (self._handle.nanoseconds() - pose.stamp) * 1e-9
        if age >= MAX_POSITION_AGE:
            return None
        return pose.position, heading(*pose.rotation)

    def trouble(self) -> str:
        """Return why it cannot fly on; an empty text when it can."""
        if self._stream is not None:
            status = self._driver_status
            is_cut_off = status.link in (VehicleStatus.LOST, VehicleStatus.DISCONNECTED)
            is_bad = is_cut_off or status.is_emergency or status.supervisor & _FAULTS
            return status.text if is_bad else self._stream.fault()
        if self._flight_state in ("on_ground", "landing", "descending"):
            return f"it does not fly any more: {self._status or self._flight_state}"
        return ""

    def has_landed(self) -> bool:
        """Return whether it stands, as far as that is known."""
        if not self._is_driven:
            return self._flight_state == "on_ground"
        place = self.position()
        if place is None:
            status = self._driver_status
            is_down = (
                status.link == VehicleStatus.CONNECTED
                and status.has_supervisor
                and not status.is_emergency
                and not status.supervisor & (_FAULTS | VehicleStatus.FLYING)
            )
        else:
            is_down = place[2] < self._ground + _ON_GROUND
        # Whoever is told then stops the motors: not on the last centimetres.
        return is_down and self._handle.time() >= self._landing_end

    def _on_pose(self, message):
        p, q = message.pose.position, message.pose.orientation
        self._pose = ((p.x, p.y, p.z), heading(q.x, q.y, q.z, q.w))
        self._seen_at = self._handle.time()

    def _on_state(self, message):
        s = message.state
        self._pose, self._seen_at = ((s.x, s.y, s.z), s.yaw), self._handle.time()

    def _on_status(self, message):
        self._status = message.data

    def _on_driver_status(self, message):
        self._driver_status = message

    def _on_flight_state(self, message):
        self._flight_state = message.data

    # Commands.

    def take_off(self, height: float, duration: float) -> "Future[Any]":
        """Climb straight up."""
        place = self.position()
        self._ground = 0.0 if place is None else place[2]

        def climb():
            return self._call("takeoff", srv.Takeoff, 0, height, _seconds(duration))

        if not self._is_driven:
            return climb()
        # The first call waits for the driver to have read the parameters, which it sets then.
        return in_turn(lambda: self._update(), lambda: self._update(_HIGH_LEVEL), climb)

    def _update(self, *parameters):
        for name in parameters:
            self._handle.set_param(f"{prefix(self.name)}/{name}", 1)
        return self._call("update_params", srv.UpdateParams, list(parameters))

    def land(self, duration: float) -> "Future[Any]":
        """Sink straight down."""
        self._landing_end = self._handle.time() + duration + _SETTLING
        return self._hand_over(
            lambda: self._call("land", srv.Land, 0, self._ground, _seconds(duration)),
            _LANDING_RETRY_TIME,
        )

    def rest(self) -> None:
        """Stop the motors of a vehicle that has landed: those of the firmware idle on."""
        if self._is_driven:
            self._call("stop", srv.Stop, 0)

    def go_to(self, goal: Triple, yaw: float, duration: float) -> "Future[Any]":
        """Fly to a point."""
        request = (0, False, Point(*goal), yaw, _seconds(duration))
        return self._hand_over(lambda: self._call("go_to", srv.GoTo, *request))

    def prepare(self, pieces: Pieces, stream: bool) -> "Future[Any]":
        """Take a trajectory, to be uploaded or streamed."""
        self._prepared = pieces if stream and self._is_driven else None
        if self._prepared is not None:
            return done(None)
        if self._is_driven and len(pieces) > MEMORY:
            return done(
                ServiceError(
                    f"the trajectory has {len(pieces)} pieces; expected at most {MEMORY}, which is "
                    "what the vehicle's memory holds, or stream=True"
                )
            )
        messages = [to_message(piece) for piece in pieces]
        return self._call("upload_trajectory", srv.UploadTrajectory, 0, 0, messages)

    def start(self) -> "Future[Any]":
        """Fly the trajectory that was prepared last."""
        if self._prepared is not None and self._stream is not None:
            return self._stream.start(self._prepared)
        if self._starter is not None:
            self._starter.start(self._services["start_trajectory"].rpartition("/")[0])
            return done(None)
        request = (0, 0, 1.0, False, False)
        return self._hand_over(
            lambda: self._call("start_trajectory", srv.StartTrajectory, *request)
        )

    def emergency(self) -> "Future[Any]":
        """Stop the motors."""
        if self._stream is not None:
            self._stream.stop()
        return self._handle.call_service(
            self._services["emergency"], Empty, EmptyRequest(), CALL_LIMIT
        )

    def _call(self, name, service_type, *arguments, limit=CALL_LIMIT):
        request = service_type._request_class(*arguments)
        return self._handle.call_service(self._services[name], service_type, request, limit)

    def _hand_over(self, send, retry_time=0.0):
        return send() if self._stream is None else self._stream.hand_over(send, retry_time)

    def _hold(self, goal):
        request = (0, False, Point(*goal.position), goal.yaw, _seconds(_HOLD_DURATION))
        return self._call("go_to", srv.GoTo, *request, limit=_HOLD_LIMIT)


def prefix(name: str) -> str:
    """Return the namespace of a vehicle; that of "/" is the root."""
    return "" if name == "/" else f"/{name}"


def fence(handle: NodeHandle, top: str) -> Bounds:
    """Return the box of a vehicle's geofence, if it has one."""
    corners = [
        [handle.get_param(f"{top}/geofence/box/{side}/{axis}", FINITE, None) for axis in "xyz"]
        for side in ("min", "max")
    ]
    if None in corners[0] + corners[1]:
        return EVERYWHERE
    return Bounds((corners[0][0], corners[0][1], corners[0][2]), tuple(corners[1]))


def _seconds(duration):
    return genpy.Duration.from_sec(duration)
