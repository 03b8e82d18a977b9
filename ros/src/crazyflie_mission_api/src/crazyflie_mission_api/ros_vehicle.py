"""Vehicles of a mission by ROS services and topics."""

from concurrent.futures import Future
from typing import Any

import genpy
from geometry_msgs.msg import Point
from std_srvs.srv import Empty, EmptyRequest
from typing_extensions import override

from crazyflie_driver import srv
from crazyflie_fleet.conversions import to_message
from crazyflie_mission_api.futures import done, in_turn
from crazyflie_mission_api.limits import EVERYWHERE, Bounds
from crazyflie_mission_api.mission_vehicle import MissionVehicle
from crazyflie_mission_api.stream import SetpointStream
from crazyflie_mission_api.synchronized_start import BroadcastStart, SynchronizedStart
from crazyflie_mission_api.timed_trajectory import START_SKEW
from crazyflie_mission_api.vehicle_state import RosVehicleState, prefix
from crazyflie_model.angles import Triple
from crazyflie_model.trajectory import Pieces
from crazyflie_utils import NodeHandle, ServiceError
from crazyflie_utils.parameters.types import FINITE

CALL_TIMEOUT = 60.0  #: Of a service, s of the machine's clock.
MEMORY = 31  #: Pieces that the memory of a vehicle holds.
_SETTLING_TIME = 0.5  #: After the planned end of a landing, s.
_HIGH_LEVEL = "commander/enHighLevel"  #: The firmware parameter that enables high-level commands.
_HOLD_DURATION = 0.5  #: Of the go_to at the end of a stream, to where the vehicle is, s.
_HOLD_TIMEOUT = 3.0  #: Of its answer, s of the machine's clock; the driver's own timeout is 1 s.

#: How long a landing is tried while setpoints are streamed, s: without an answer they would end
#: with the mission, and the vehicle would fall.
_LANDING_RETRY_TIME = 10.0


class RosVehicle(RosVehicleState, MissionVehicle):
    """A vehicle by the services of the driver, or by those of `HighLevelNode`.

    ``services`` are short names, such as go_to, to absolute names. Vehicles that a controller
    flies, and not the driver, have a ``synchronized_start``. The attribute ``broadcast`` starts
    those of the driver together, if it is not None.
    """

    def __init__(
        self,
        name: str,
        handle: NodeHandle,
        services: dict[str, str],
        synchronized_start: SynchronizedStart | None = None,
        frames: tuple[str, str] | None = None,
        has_yaw: bool = True,
    ):
        uses_driver = synchronized_start is None
        super().__init__(name, handle, uses_driver, frames, has_yaw)
        self.bounds = fence(handle, prefix(name))
        self.start_skew = START_SKEW if uses_driver else 0.0
        self.services = services
        self._synchronized_start = synchronized_start
        self.broadcast: BroadcastStart | None = None
        self._stream: SetpointStream | None = None
        self._prepared: Pieces | None = None
        if uses_driver:
            frame = "" if frames is None else frames[0]
            self._stream = SetpointStream(
                handle, f"{prefix(name)}/cmd_full_state", frame, self._hold
            )

    @override
    def fault(self) -> str:
        return super().fault() or ("" if self._stream is None else self._stream.fault())

    # Commands.

    @override
    def take_off(self, height: float, duration: float, group_mask: int = 0) -> "Future[Any]":
        place = self.position()
        self._ground = 0.0 if place is None else place[2]

        def climb():
            return self.call("takeoff", srv.Takeoff, group_mask, height, seconds(duration))

        if not self.uses_driver:
            return climb()
        # The first call waits for the driver to have read the parameters, which it sets then.
        parameter = f"{prefix(self.name)}/{_HIGH_LEVEL}"
        return in_turn(
            lambda: self.call("update_params", srv.UpdateParams, []),
            lambda: self._handle.set_param_later(parameter, 1),
            lambda: self.call("update_params", srv.UpdateParams, [_HIGH_LEVEL]),
            climb,
        )

    @override
    def land(self, duration: float) -> "Future[Any]":
        self._landing_end = self._handle.time() + duration + _SETTLING_TIME
        return self._hand_over(
            lambda: self.call("land", srv.Land, 0, self._ground, seconds(duration)),
            _LANDING_RETRY_TIME,
        )

    @override
    def stop_motors(self) -> None:
        if self.uses_driver:
            self.call("stop", srv.Stop, 0)

    @override
    def go_to(self, goal: Triple, yaw: float, duration: float) -> "Future[Any]":
        request = (0, False, Point(*goal), yaw, seconds(duration))
        return self._hand_over(lambda: self.call("go_to", srv.GoTo, *request))

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
        messages = [to_message(piece) for piece in pieces]
        return self.call("upload_trajectory", srv.UploadTrajectory, 0, 0, messages)

    @override
    def start(self) -> "Future[Any]":
        if self._prepared is not None and self._stream is not None:
            return self._stream.start(self._prepared)
        if self._synchronized_start is not None:
            self._synchronized_start.start(self.services["start_trajectory"].rpartition("/")[0])
            return done(None)
        return self._hand_over(self._start_with_others)

    def _start_with_others(self):
        def start():
            return self.call("start_trajectory", srv.StartTrajectory, 0, 0, 1.0, False, False)

        return start() if self.broadcast is None else self.broadcast.start(self.name, start)

    @override
    def emergency(self) -> "Future[Any]":
        if self._stream is not None:
            self._stream.stop()
        return self._handle.call_service(
            self.services["emergency"], Empty, EmptyRequest(), CALL_TIMEOUT
        )

    def call(
        self, name: str, service_type: Any, *arguments: Any, limit: float = CALL_TIMEOUT
    ) -> "Future[Any]":
        """Call a service by its short name; ``limit`` is in s of the machine's clock."""
        request = service_type._request_class(*arguments)
        return self._handle.call_service(self.services[name], service_type, request, limit)

    def _hand_over(self, send, retry_time=0.0):
        return send() if self._stream is None else self._stream.hand_over(send, retry_time)

    def _hold(self, goal):
        request = (0, False, Point(*goal.position), goal.yaw, seconds(_HOLD_DURATION))
        return self.call("go_to", srv.GoTo, *request, limit=_HOLD_TIMEOUT)


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
    """Return a duration, s, as ROS has it."""
    return genpy.Duration.from_sec(duration)
