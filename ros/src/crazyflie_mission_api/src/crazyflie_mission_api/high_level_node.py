"""The driver's high-level services for a vehicle that the workspace's controller flies."""

import math
from concurrent.futures import Future
from typing import Any

from std_msgs.msg import String
from std_srvs.srv import Empty, EmptyResponse
from typing_extensions import override

from crazyflie_driver import srv
from crazyflie_driver.msg import FullState, Position
from crazyflie_mission_api.conversions import from_message, reference_message, setpoint_goal
from crazyflie_mission_api.flight_words import WORDS
from crazyflie_mission_api.follower import Follower
from crazyflie_mission_api.high_level_parameters import HighLevelParameters
from crazyflie_mission_api.service_relay import relay
from crazyflie_model.polynomials import Goal, at_rest
from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils import Node, NodeHandle, ServiceError, flight_status
from crazyflie_utils.refusal import RefusalError

MAX_STATE_AGE = 0.5
"""Of a state that says where the vehicle is, and of the last setpoint of a stream, s."""

FIRST_CLIMB = 1.0
"""Highest takeoff of the takeoff server, m; the rest of a climb follows in flight."""


class HighLevelNode(Node):
    """Fly a vehicle by high-level commands: make references for its controller.

    In its own namespace it offers the services of the driver for a real vehicle, so that the same
    clients fly simulated vehicles. It publishes nothing on the ground, and during takeoff and
    landing.
    """

    needed_in_flight = True

    def __init__(self) -> None:
        self._follower = Follower()
        self._flight_state = FlightStatus.UNKNOWN
        self._measured: Goal[float] | None = None
        self._measured_at = 0.0
        self._is_moving = False
        # When the last setpoint came; None without a stream.
        self._setpoint_time: float | None = None
        # The goal of a takeoff by this node, instead of the server's hover point.
        self._hover: Goal[float] | None = None
        # A command during a takeoff, for its end.
        self._next: tuple[Any, ...] | None = None
        self._landings: list[Future[Any]] = []

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(HighLevelParameters)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        message_type = parameters.reference_type
        self._reference = handle.publisher(parameters.reference_topic, message_type)
        for name, service_type, callback in (
            ("takeoff", srv.Takeoff, self._on_takeoff),
            ("land", srv.Land, self._on_land),
            ("stop", srv.Stop, self._on_stop),
            ("emergency", Empty, self._on_emergency),
            ("go_to", srv.GoTo, self._on_go_to),
            ("upload_trajectory", srv.UploadTrajectory, self._on_upload),
            ("start_trajectory", srv.StartTrajectory, self._on_start),
            ("notify_setpoints_stop", srv.NotifySetpointsStop, self._on_setpoints_stop),
            # There are no groups and no firmware here.
            ("set_group_mask", srv.SetGroupMask, lambda _: srv.SetGroupMaskResponse()),
            ("update_params", srv.UpdateParams, lambda _: srv.UpdateParamsResponse()),
        ):
            handle.advertise_service(f"~{name}", service_type, callback)
        flight_status.subscribe(
            handle,
            parameters.flight_status_topic,
            parameters.flight_state_topic,
            lambda status: self._set_flight_state(status.state),
        )
        state_type = PositionVelocityYawStateStamped
        handle.subscribe(parameters.state_topic, state_type, self._on_state, finite="state")
        handle.subscribe(parameters.reference_topic, message_type, self._on_reference)
        handle.subscribe(parameters.start_topic, String, self._on_start_all)
        handle.subscribe("~cmd_full_state", FullState, self._on_setpoint)
        handle.subscribe("~cmd_position", Position, self._on_setpoint)
        handle.timer(parameters.time_step, self._on_timer)

    @override
    def enter_safe_state(self) -> None:
        """Leave the controller a reference at rest."""
        goal = self._follower.goal(self._handle.time())
        moves = self._is_moving or self._setpoint_time is not None
        if self._flight_state == FlightStatus.FLYING and moves and goal is not None:
            self._publish(at_rest(goal.position, goal.yaw))
        self._forget_goal()

    def _forget_goal(self):
        self._follower.forget()
        self._is_moving = False
        self._setpoint_time = None

    # State of the vehicle.

    def _on_state(self, message):
        s = message.state
        yaw = s.yaw if self._parameters.has_yaw else 0.0
        velocity = (s.x_dot, s.y_dot, s.z_dot)
        self._measured = Goal((s.x, s.y, s.z), velocity, (0.0,) * 3, yaw, 0.0)
        self._measured_at = self._handle.time()

    def _set_flight_state(self, state):
        before, self._flight_state = self._flight_state, state
        if state == before:
            return
        if state != FlightStatus.TAKING_OFF:
            self._hover = None
            if before == FlightStatus.TAKING_OFF and state != FlightStatus.FLYING:
                # A command during an aborted takeoff must not take effect after the next one.
                self._next = None
        if state == FlightStatus.FLYING:
            command, self._next = self._next, None
            if command is not None:
                self._begin_or_log(*command)
        else:
            self._forget_goal()
        if state in (FlightStatus.DESCENDING, FlightStatus.LANDING):
            landings, self._landings = self._landings, []
            for answer in landings:
                if not answer.done():
                    answer.set_result(srv.LandResponse())

    def _on_reference(self, message):
        # With its hover point the server leaves the vehicle to the controller, until it flies.
        if self._flight_state != FlightStatus.TAKING_OFF or self._hover is None:
            return
        s = message.state
        if (s.x, s.y, s.z) != self._hover.position:
            self._publish(self._hover)

    def _present(self):
        age = self._handle.time() - self._measured_at
        if self._measured is None or not 0.0 <= age < MAX_STATE_AGE:
            topic = self._handle.resolve(self._parameters.state_topic)
            raise ServiceError(f"no state has come on {topic} for {MAX_STATE_AGE:g} s")
        return self._measured

    # Commands.

    def _on_takeoff(self, request):
        duration = request.duration.to_sec()
        if not (request.height > 0.0 and math.isfinite(request.height) and duration > 0.0):
            raise ServiceError(
                f"height and duration are {request.height:g} m and {duration:g} s; expected "
                "more than 0"
            )
        start = self._present()
        x, y, ground = start.position
        if request.height <= ground:
            raise ServiceError(
                f"height is {request.height:g} m, and the vehicle is at {ground:.2f} m; expected "
                "more"
            )
        self._hover = at_rest((x, y, min(request.height, ground + FIRST_CLIMB)), start.yaw)
        self._next = (Follower.go_to, (x, y, request.height), start.yaw, duration)
        call = relay(self._handle, self._parameters.takeoff, srv.TakeoffResponse)
        call.add_done_callback(self._handle.guard(self._forget_refused))
        return call

    def _forget_refused(self, call):
        if call.exception() is not None:
            self._hover = self._next = None

    def _on_land(self, _):
        answer = relay(self._handle, self._parameters.land, srv.LandResponse)
        # The server answers after the landing, the driver when it begins.
        self._landings.append(answer)
        return answer

    def _on_emergency(self, _):
        self._follower.forget()
        return relay(self._handle, self._parameters.emergency, EmptyResponse)

    def _on_stop(self, _):
        if self._flight_state in (FlightStatus.FLYING, FlightStatus.TAKING_OFF):
            raise ServiceError(
                f"the vehicle is {WORDS[self._flight_state]}; expected it to have landed: stop "
                "would let it fall, which is what emergency is for"
            )
        return srv.StopResponse()

    def _on_go_to(self, request):
        if request.yaw and not self._parameters.has_yaw:
            raise ServiceError(
                f"yaw is {request.yaw:g} rad, and the controller keeps the heading 0; expected 0"
            )
        goal = (request.goal.x, request.goal.y, request.goal.z)
        duration = request.duration.to_sec()
        self._execute(Follower.go_to, goal, request.yaw, duration, request.relative)
        return srv.GoToResponse()

    def _on_upload(self, request):
        try:
            self._follower.upload(request.trajectoryId, [from_message(p) for p in request.pieces])
        except RefusalError as reason:
            raise ServiceError(str(reason)) from None
        return srv.UploadTrajectoryResponse()

    def _on_start(self, request):
        flown = (request.trajectoryId, request.timescale, request.reversed, request.relative)
        self._execute(Follower.start, *flown)
        return srv.StartTrajectoryResponse()

    def _on_start_all(self, message):
        if self._handle.name not in message.data.split():
            return
        if self._flight_state == FlightStatus.FLYING:
            self._begin_or_log(Follower.start, 0)
        else:
            self._handle.error(f"not started: the vehicle is {WORDS[self._flight_state]}")

    def _on_setpoints_stop(self, _):
        self._end_stream()
        return srv.NotifySetpointsStopResponse()

    def _execute(self, command, *arguments):
        if self._flight_state == FlightStatus.TAKING_OFF:
            self._next = (command, *arguments)
        elif self._flight_state == FlightStatus.FLYING:
            self._begin(command, *arguments)
        else:
            raise ServiceError(f"the vehicle is {WORDS[self._flight_state]}; expected it to fly")

    def _begin(self, command, *arguments):
        try:
            command(self._follower, self._handle.time(), self._present(), *arguments)
        except RefusalError as reason:
            raise ServiceError(str(reason)) from None
        self._setpoint_time = None
        self._is_moving = True

    def _begin_or_log(self, command, *arguments):
        try:
            self._begin(command, *arguments)
        except ServiceError as reason:
            self._handle.error(f"not done: {reason}")

    # Setpoints.

    def _on_setpoint(self, message):
        goal = setpoint_goal(message)
        if not all(map(math.isfinite, (*goal.position, *goal.velocity, goal.yaw))):
            self._handle.warn("ignoring a setpoint that is not finite", throttle=1.0)
        elif self._flight_state == FlightStatus.FLYING:
            self._is_moving = False
            self._setpoint_time = self._handle.time()
            self._follower.take_setpoint(goal)
            self._publish(goal)

    def _end_stream(self):
        last = self._follower.goal(self._handle.time())
        if self._setpoint_time is None or last is None:
            return
        self._forget_goal()
        try:
            self._begin(Follower.go_to, last.position, last.yaw, 0.5)
        except ServiceError as reason:
            # The last reference has a velocity, and the controller goes on with it.
            self._handle.warn(f"setpoints have stopped, and {reason}: stays at the last one")
            self._publish(at_rest(last.position, last.yaw))

    def _on_timer(self):
        now = self._handle.time()
        last = self._setpoint_time
        if last is not None and not 0.0 <= now - last < MAX_STATE_AGE:
            self._end_stream()
        if not self._is_moving:
            return
        goal = self._follower.goal(now)
        # The last one, at rest, is published, too.
        self._is_moving = self._follower.is_moving(now)
        if goal is not None:
            self._publish(goal)

    def _publish(self, goal):
        message = reference_message(goal, self._parameters.has_yaw)
        message.header.stamp = self._handle.stamp()
        self._reference.publish(message)
