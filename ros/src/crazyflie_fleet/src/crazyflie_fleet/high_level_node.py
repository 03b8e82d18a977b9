"""The driver's high-level services for a vehicle that the workspace's controller flies."""

import math
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import Any

from std_msgs.msg import Empty as EmptyMessage
from std_msgs.msg import String
from std_srvs.srv import Empty
from typing_extensions import override

from crazyflie_driver import srv
from crazyflie_driver.msg import FullState, Hover, Position, VelocityWorld
from crazyflie_driver.trajectory_messages import from_message
from crazyflie_fleet.commanded_references import CommandedReferences
from crazyflie_fleet.follower import CommandFollower
from crazyflie_fleet.high_level_services import (
    HighLevelParameters,
    relay,
    setpoint_of,
)
from crazyflie_fleet.references_node import TrackedVehicle
from crazyflie_model.limits import HOLD_LIMIT
from crazyflie_model.polynomials import Goal, at_rest
from crazyflie_msgs.msg import FlightStatus
from crazyflie_utils import Node, NodeHandle
from crazyflie_utils.flight_status import WORDS
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.timers import Timer
from crazyflie_utils.vectors import to_tuple

CLIMB_SPEED = 0.7  #: Largest mean speed of a takeoff (m/s).


@dataclass
class _Takeoff:
    """A takeoff by this node.

    Its references begin `HOLD_LIMIT` after the takeoff server has handed over: until then the
    filter holds the server's last control.
    """

    hover: Goal[float]
    end: float  # End of the takeoff (s).
    handover: Timer | None = None
    is_followed: bool = False


class HighLevelNode(Node[HighLevelParameters]):
    """Flies a vehicle by high-level commands: publishes references for its controller.

    In its own namespace it offers the services of the driver for a real vehicle, so that the same
    clients fly simulated vehicles. It is silent on the ground and during landing.
    In the process of a fleet it is given the vehicle; then it offers /NAME/go_to, too: the same
    with limits of speed and acceleration.
    """

    needed_in_flight = True

    def __init__(self, vehicle: TrackedVehicle | None = None) -> None:
        self._vehicle = vehicle
        self._status = FlightStatus()
        self._groups = 0  # Mask of the groups of the vehicle; at first it has no group.
        self._takeoff: _Takeoff | None = None
        # Begins a command that was received in a takeoff, at its end.
        self._next: Callable[[], None] | None = None
        self._landings: list[Future[Any]] = []

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._references = CommandedReferences(handle, parameters, self._vehicle)
        for name, service_type, callback in (
            ("takeoff", srv.Takeoff, self._on_takeoff),
            ("land", srv.Land, self._on_land),
            ("stop", srv.Stop, self._on_stop),
            ("go_to", srv.GoTo, self._on_go_to),
            ("start_trajectory", srv.StartTrajectory, self._on_start),
        ):
            call = partial(self._for_members, callback)
            handle.advertise_service(f"~{name}", service_type, call)
        for name, service_type, callback in (
            ("emergency", Empty, self._on_emergency),
            ("upload_trajectory", srv.UploadTrajectory, self._on_upload),
            ("notify_setpoints_stop", srv.NotifySetpointsStop, self._on_setpoints_stop),
            ("set_group_mask", srv.SetGroupMask, self._on_set_group_mask),
            # Services that only the firmware could carry out.
            ("update_params", srv.UpdateParams, lambda _: None),
        ):
            handle.advertise_service(f"~{name}", service_type, callback)
        parameters.flight.subscribe(handle, self._on_flight_status)
        if self._vehicle is None:
            topic = parameters.reference_topic
            handle.subscribe(topic, parameters.reference_type, lambda _: self._on_reference())
        else:
            self._vehicle.on_reference = self._on_reference
            self._vehicle.on_interruption = self._references.forget
            self._vehicle.ahead = self._references.ahead
            handle.advertise_service("go_to", srv.GoTo, self._on_limited_go_to)
        handle.subscribe(parameters.start_topic, String, self._on_start_all)
        for name, message_type in (
            ("full_state", FullState),
            ("position", Position),
            ("velocity_world", VelocityWorld),
            ("hover", Hover),
        ):
            handle.subscribe(f"~cmd_{name}", message_type, self._on_setpoint)
        handle.subscribe("~cmd_stop", EmptyMessage, self._on_stop_setpoint)

    @override
    def enter_safe_state(self) -> None:
        """Publish a reference at rest."""
        if self._is_followed():
            self._references.rest()
        self._references.forget()

    # State of the flight.

    def _on_flight_status(self, status):
        before, self._status = self._status.state, status
        if status.state == before:
            return
        if status.state == FlightStatus.FLYING:
            self._take_over()
            self._takeoff = None
            return
        self._references.forget()
        if before == FlightStatus.TAKING_OFF:
            # A command during an aborted takeoff must not take effect after the next one.
            self._forget_takeoff()
        if status.state in (FlightStatus.DESCENDING, FlightStatus.LANDING):
            landings, self._landings = self._landings, []
            for answer in landings:
                if not answer.done():
                    answer.set_result(None)

    def _on_reference(self):
        # When it sends the hover point, the server hands the vehicle over to the controller.
        takeoff = self._takeoff
        if takeoff is None or takeoff.handover or self._status.state != FlightStatus.TAKING_OFF:
            return
        takeoff.handover = self._handle.timer(HOLD_LIMIT, self._take_over)
        x, y, _ = takeoff.hover.position
        try:
            height = self._references.present().position[2]
        except RefusalError:
            height = takeoff.hover.position[2]
        self._references.publish(at_rest((x, y, height), takeoff.hover.yaw))

    def _take_over(self):
        """Begin the references of a takeoff by this node, and the command for its end."""
        takeoff = self._takeoff
        if takeoff is not None and not takeoff.is_followed:
            takeoff.is_followed = True
            self._climb(takeoff)
        begin_next, self._next = self._next, None
        if begin_next is not None:
            begin_next()

    def _climb(self, takeoff):
        if takeoff.handover is not None:
            takeoff.handover.stop()
        references, hover = self._references, takeoff.hover
        try:
            way = hover.position[2] - references.present().position[2]
            left = takeoff.end - self._handle.time()
            duration = max(left, abs(way) / CLIMB_SPEED, self._parameters.time_step)
            references.begin(CommandFollower.go_to, hover.position, hover.yaw, duration)
            references.publish()
        except RefusalError as reason:
            self._handle.warn(f"takeoff: {reason}")
            references.publish(hover)

    def _forget_takeoff(self):
        if self._takeoff is not None and self._takeoff.handover is not None:
            self._takeoff.handover.stop()
        self._takeoff = self._next = None

    def _is_followed(self):
        """Return whether the controller follows the references of this node."""
        if self._status.state == FlightStatus.TAKING_OFF:
            return self._takeoff is not None and self._takeoff.is_followed
        return self._status.state == FlightStatus.FLYING

    # Commands.

    def _on_set_group_mask(self, request):
        self._groups = request.groupMask

    def _for_members(self, callback, request):
        """Call ``callback(request)``; ignore requests to other groups, as the firmware does."""
        # The mask of a command to all vehicles is 0.
        if request.groupMask == 0 or request.groupMask & self._groups:
            return callback(request)
        return None

    def _on_takeoff(self, request):
        duration = request.duration.to_sec()
        if not (request.height > 0.0 and math.isfinite(request.height) and duration > 0.0):
            raise RefusalError(
                f"height and duration are {request.height:g} m and {duration:g} s; expected "
                "more than 0"
            )
        start = self._references.present()
        x, y, ground = start.position
        if request.height <= ground:
            raise RefusalError(
                f"height is {request.height:g} m, and the vehicle is at {ground:.2f} m; expected "
                "a greater height"
            )
        hover = at_rest((x, y, request.height), start.yaw)
        if self._is_followed() or self._takeoff is not None:
            self._execute(CommandFollower.go_to, hover.position, hover.yaw, duration)
            return None
        takeoff = self._takeoff = _Takeoff(hover, self._handle.time() + duration)

        def forget_refused(call):
            if call.exception() is not None and self._takeoff is takeoff:
                self._forget_takeoff()

        call = relay(self._handle, self._parameters.takeoff)
        call.add_done_callback(self._handle.guard(forget_refused))
        return call

    def _on_land(self, _):
        if self._status.state == FlightStatus.ON_GROUND:
            return None
        answer = relay(self._handle, self._parameters.land)
        if self._status.state in (FlightStatus.DESCENDING, FlightStatus.LANDING):
            return None
        # The server answers after the landing, the driver when it begins.
        self._landings.append(answer)
        return answer

    def _on_emergency(self, _):
        self._references.forget()
        return relay(self._handle, self._parameters.emergency)

    def _on_stop(self, _):
        if self._status.state in (FlightStatus.FLYING, FlightStatus.TAKING_OFF):
            raise RefusalError(
                f"the vehicle is {WORDS[self._status.state]}; expected it to have landed: stop "
                "would let it fall; for that, call emergency"
            )

    def _on_go_to(self, request):
        self._execute(CommandFollower.go_to, *self._move(request))

    def _on_limited_go_to(self, request):
        move = self._move(request)
        try:
            self._go(CommandFollower.go_to, *move, True)
        except RefusalError as reason:
            raise RefusalError(f"{self._handle.resolve('go_to')} refused: {reason}") from None

    def _move(self, request):
        """Return the arguments of `CommandFollower.go_to`."""
        if request.yaw and not self._parameters.has_yaw and not math.isnan(request.yaw):
            raise RefusalError(
                f"yaw is {request.yaw:g} rad, and the controller keeps the heading 0; expected 0"
            )
        yaw = None if math.isnan(request.yaw) else request.yaw
        return to_tuple(request.goal), yaw, request.duration.to_sec(), request.relative

    def _on_upload(self, request):
        turns = any(any(piece.poly_yaw) for piece in request.pieces)
        if turns and not self._parameters.has_yaw:
            raise RefusalError(
                f"trajectory {request.trajectoryId} has a yaw, and the controller keeps the "
                "heading 0; expected coefficients 0"
            )
        pieces = [from_message(piece) for piece in request.pieces]
        self._references.follower.upload(request.trajectoryId, pieces)

    def _on_start(self, request):
        flown = (request.trajectoryId, request.timescale, request.reversed, request.relative)
        self._execute(CommandFollower.start, *flown)

    def _on_start_all(self, message):
        if self._handle.name not in message.data.split():
            return
        if self._status.state == FlightStatus.FLYING:
            self._begin_or_log(CommandFollower.start, 0)
        else:
            self._handle.error(f"not started: the vehicle is {WORDS[self._status.state]}")

    def _on_setpoints_stop(self, _):
        self._references.end_setpoints()

    def _is_to_land(self):
        """Return whether only the fleet moves the vehicle."""
        return self._vehicle is not None and self._vehicle.is_to_land

    def _refuse_if_to_land(self):
        if self._is_to_land():
            raise RefusalError("the fleet is landing the vehicle; it takes no commands")

    def _execute(self, command, *arguments):
        self._refuse_if_to_land()
        self._go(command, *arguments)

    def _go(self, command, *arguments):
        if self._is_followed():
            if self._vehicle is not None and self._status.state == FlightStatus.FLYING:
                self._references.adopt(self._vehicle.commanded())
            self._references.begin(command, *arguments)
        elif self._status.state == FlightStatus.TAKING_OFF:
            self._references.planned(command, *arguments)
            self._next = partial(
                self._begin_or_log, command, *arguments, is_of_landing=self._is_to_land()
            )
        else:
            raise RefusalError(f"the vehicle is {WORDS[self._status.state]}; expected it to fly")

    def _begin_or_log(self, command, *arguments, is_of_landing=False):
        try:
            if not is_of_landing:
                self._refuse_if_to_land()
            self._references.begin(command, *arguments)
        except RefusalError as reason:
            self._handle.error(f"not done: {reason}")

    # Setpoints of the driver.

    def _on_stop_setpoint(self, _):
        self._handle.warn("ignoring cmd_stop: a vehicle in flight would fall", throttle=1.0)

    def _on_setpoint(self, message):
        setpoint = straight = setpoint_of(message)
        if isinstance(setpoint, Goal):
            numbers = [*setpoint.position, *setpoint.velocity, setpoint.yaw]
            straight = setpoint._replace(yaw=0.0, yaw_rate=0.0)
        else:
            numbers = [*setpoint.velocity, setpoint.yaw_rate, setpoint.height or 0.0]
            straight = setpoint._replace(yaw_rate=0.0)
        if not all(map(math.isfinite, numbers)):
            self._handle.warn("ignoring a setpoint that is not finite", throttle=1.0)
            return
        if setpoint != straight and not self._parameters.has_yaw:
            text = "the controller keeps the heading 0: yaw and yaw rate of setpoints are ignored"
            self._handle.warn(text, throttle=10.0)
            setpoint = straight
        if self._is_followed() and not self._is_to_land():
            try:
                self._references.take(setpoint, self._status.ground)
            except RefusalError as reason:
                self._handle.warn(f"ignoring a setpoint: {reason}", throttle=1.0)
