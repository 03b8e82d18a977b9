"""ROS interface of takeoff and landing."""

from concurrent.futures import Future

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Empty, Float32, Float64, String
from std_srvs.srv import Empty as EmptyService
from typing_extensions import override

from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    EstimateStatus,
    FilterStatus,
    FlightStatus,
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_takeoff import flight_topics
from crazyflie_takeoff.envelope import hover_complaint
from crazyflie_takeoff.guards import first_firing
from crazyflie_takeoff.motion import Motion
from crazyflie_takeoff.phases import FilterState, FlightState, flight_state
from crazyflie_takeoff.refusals import WATCH, TakeoffChecks
from crazyflie_takeoff.server_parameters import TakeoffServerParameters
from crazyflie_takeoff.server_table import (
    ARRIVED,
    NO_FILTER,
    REFUSALS,
    FilterReport,
    FlightStateMachine,
    Request,
    ServerState,
)
from crazyflie_utils import Node, NodeHandle, ParameterError, ServiceError, flight_status
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.vectors import from_vector, stamped

TIME_STEP = 0.01  #: Period of the server (s).
CRUISE_TIME_STEP = 0.1  #: Period in flight, where it only watches the battery (s).
GROUND_TIME_STEP = 0.05  #: Period on the ground, where it repeats zero thrust (s).
STATUS_PERIOD = 0.1  #: Period at which the status is compared with the published one (s).
RECOVERY_LIMIT = 1.0  #: Time that a server waits for evidence of the flight when it starts (s).

#: Longest descent when the process is to end (s): together with the ramp that is less than the 10 s
#: for which a process with a flight goes on.
LEAVE_LIMIT = 7.0

#: Time after the start of the server during which a takeoff waits for the first state and for a
#: controller (s): nodes that are launched together need a while to find each other.
START_LIMIT = 5.0

# States in which the call of a takeoff may be under way.
_TAKES_OFF = (FlightState.TAKING_OFF, FlightState.FLYING)
_ENDED = "the flight was ended by the filter: {}"
# For an operator, both parts of a landing are one.
_LOG_WORDS = flight_status.WORDS | {FlightStatus.DESCENDING: "landing"}


class TakeoffServerNode(Node):
    """Node with the services for takeoff and landing."""

    needed_in_flight = True

    def __init__(self) -> None:
        # Whether nodes that were launched together may not be connected yet.
        self._is_starting = True
        # Service calls are answered at the end of a takeoff or a landing. At most one is under way;
        # of those that wait, in their order, it is not known yet whether they may begin.
        self._under_way: Future[None] = Future()
        self._waiting: list[tuple[Request, Future[None]]] = []
        self._state: FlightState | None = None  # The last state that was published.
        self._reason = ""  # Why the last landing or abort began.
        self._published: tuple[object, ...] | None = None
        self._published_text = ""
        self._logged_word = self._logged_reason = ""
        # Time for which this process has run, the last look, and since when guards fire (s).
        self._ran, self._watched = 0.0, 0.0
        self._firing: dict[str, float] = {}

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(TakeoffServerParameters, self._reconfigure)
        self._checks = TakeoffChecks(self._parameters, handle.resolve)
        self._flight = FlightStateMachine(self._parameters.plan())

    def _reconfigure(self, parameters):
        if complaint := hover_complaint(parameters.hover, self._checks.box):
            raise ParameterError(complaint)
        self._parameters = self._checks.parameters = parameters
        self._flight.plan = parameters.plan()

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters, checks = self._parameters, self._checks
        self._control = handle.publisher(parameters.control_topic, ControlStamped)
        self._reference = handle.publisher(
            parameters.reference_topic, PositionVelocityStateStamped, latch=True
        )
        self._descent = handle.publisher(parameters.descent_topic, PositionVelocityStateStamped)
        self._hover_thrust = handle.publisher(parameters.hover_thrust_topic, Float64, latch=True)
        self._in_flight = handle.publisher(parameters.in_flight_topic, Empty)
        self._status = handle.publisher(parameters.flight_status_topic, FlightStatus, latch=True)
        self._text = handle.publisher(parameters.status_topic, String, latch=True)
        self._diagnostics = handle.publisher("/diagnostics", DiagnosticArray)
        self._inhibit_shutdown = handle.inhibit_shutdown(self._on_end_of_node)
        handle.advertise_service(parameters.takeoff_service, EmptyService, self._on_takeoff)
        handle.advertise_service(parameters.land_service, EmptyService, self._on_land)
        handle.subscribe(parameters.filter_status_topic, FilterStatus, self._on_filter_status)
        if parameters.box_topic is not None:
            flight_topics.follow_box(handle, parameters.box_topic, checks.set_box)
        if parameters.battery_topic is not None:
            handle.subscribe(parameters.battery_topic, Float32, self._on_battery)
        flight_topics.follow_driver(handle, parameters, checks.vehicle)
        if (topic := parameters.positioning_topic) is not None:
            handle.subscribe(topic, String, self._on_positioning)
        if parameters.inhibition_topic is not None:
            handle.subscribe(parameters.inhibition_topic, String, self._on_inhibition)
        if parameters.state_topic is not None:
            handle.subscribe(
                parameters.state_topic,
                PositionVelocityYawStateStamped,
                self._on_state,
                finite="state",
                latest_only=True,
            )
            handle.subscribe(
                parameters.estimate_status_topic, EstimateStatus, self._on_estimate_status
            )
        else:
            handle.warn(
                "topics/state is not set: a landing is a fall of the thrust from wherever the "
                "vehicle is; set it to the topic of the vehicle's states for a descent"
            )
        self._timer = handle.timer(TIME_STEP, self._on_timer)
        # Connections are made in real time, also where time is simulated.
        self._recovery_timer = handle.timer(RECOVERY_LIMIT, self._recover, steady=True)
        self._start_timer = handle.timer(START_LIMIT, self._end_start, steady=True)
        handle.timer(STATUS_PERIOD, self._publish_status, steady=True, stagger=True)
        period = flight_topics.DIAGNOSTICS_PERIOD
        handle.timer(period, self._publish_diagnostics, steady=True, stagger=True)

    @override
    def prepare_shutdown(self) -> None:
        """Begin a landing, with a descent of at most `LEAVE_LIMIT`."""
        self._land_soon("the launch is to end", f"{self._handle.name} is to end")

    def _on_end_of_node(self, name):
        self._land_soon(f"{name} is to end")

    def _land_soon(self, reason, failure=""):
        self._end(Request.LAND, reason, failure)
        self._flight.limit_descent(LEAVE_LIMIT)
        self._set_pace()

    @override
    def enter_safe_state(self) -> None:
        """Abort a takeoff with a landing, continue a landing, and fail the calls."""
        if self._flight.flight_state is FlightState.TAKING_OFF:
            self._flight.request(Request.LAND)
        failure = f"{self._handle.name} has failed or is shutting down; see its log"
        self._answer(failure)
        self._fail_waiting(failure)

    # Services.

    def _on_takeoff(self, _):
        return self._serve(Request.TAKEOFF)

    def _on_land(self, _):
        return self._serve(Request.LAND)

    def _serve(self, event):
        future: Future[None] = Future()
        self._waiting.append((event, future))
        self._serve_waiting()
        return future.result() if future.done() else future

    def _serve_waiting(self):
        if self._flight.state is ServerState.RECOVERING:
            return
        now, checks = self._handle.time(), self._checks
        may_wait = self._is_starting and checks.may_become_complete(now)
        may_wait = may_wait or checks.vehicle.is_soon_ready(now)
        may_wait = may_wait and not self._flight.filter.stops
        waiting, self._waiting = self._waiting, []
        for event, future in waiting:
            if event is Request.TAKEOFF and may_wait:
                self._waiting.append((event, future))
            else:
                self._begin(event, future)
        self._set_pace()

    def _begin(self, event, future):
        takes_off = event is Request.TAKEOFF
        parameters = self._parameters
        name = self._handle.resolve(
            parameters.takeoff_service if takes_off else parameters.land_service
        )
        if not takes_off:
            self._fail_waiting(f"takeoff aborted: {name} was called")
        try:
            is_next = takes_off and self._flight.accepts(event)
            if is_next and (reason := self._takeoff_refusal()):
                raise RefusalError(reason)
            self._flight.request(event)
        except RefusalError as reason:
            future.set_exception(ServiceError(f"{name} refused: {reason}"))
            return
        if takes_off:
            self._handle.set_param_later("~ground", self._flight.ground)
        self._reason = ""
        self._answer(f"takeoff aborted: {name} was called")
        self._under_way = future

    def _answer(self, failure=""):
        """Answer the call that is under way, if there is one; it fails if a failure is given."""
        if self._under_way.done():
            return
        if failure:
            self._under_way.set_exception(ServiceError(failure))
        else:
            self._under_way.set_result(None)

    def _fail_waiting(self, failure):
        while self._waiting:
            self._waiting.pop(0)[1].set_exception(ServiceError(failure))

    def _end_start(self):
        self._start_timer.stop()
        self._is_starting = False

    # Inputs.

    def _on_filter_status(self, message):
        try:
            state, remembered = FilterState(message.state), flight_state(message.flight_state)
        except ValueError:
            self._handle.warn(
                f"ignoring state {message.state}, flight_state {message.flight_state} on "
                f"{self._parameters.filter_status_topic}; expected constants of FilterStatus and "
                "FlightStatus",
                throttle=1.0,
                key="filter status",
            )
            return
        self._checks.set_controller(message.has_controller)
        # Only of an idle filter: another one says more by its state.
        is_idle = state in (FilterState.PASSING, FilterState.DOWN)
        refusal = message.takeoff_refusal if is_idle else ""
        report = FilterReport(state, remembered, message.is_commanded, message.reason, refusal)
        before, flight = self._flight.flight_state, self._flight
        if (flight.set_filter(report) or flight.yields) and report.takes_over:
            self._reason = refusal or message.reason
            # In flight, a call that is under way is that of the takeoff.
            if report.stops or before in _TAKES_OFF:
                self._answer(_ENDED.format(self._reason))
        self._set_pace()

    def _on_inhibition(self, message):
        self._checks.inhibition = message.data

    def _on_positioning(self, message):
        self._checks.positioning = message.data

    def _on_battery(self, message):
        if message.data == message.data:
            self._checks.battery.measure(self._handle.time(), message.data)

    def _on_state(self, message):
        state, age = message.state, self._handle.age(message.header.stamp)
        motion = Motion((state.x, state.y, state.z), (state.x_dot, state.y_dot, state.z_dot))
        self._checks.measured.update(self._handle.time(), motion, age)

    def _on_estimate_status(self, message):
        self._checks.measured.missing_reason = message.reason
        self._checks.is_tilted = message.is_tilted

    def _measured_position(self):
        return self._checks.measured.position(self._handle.time())

    # The flight.

    def _on_timer(self):
        if self._flight.state is ServerState.RECOVERING and self._has_all_evidence():
            self._recover()
        if self._waiting:
            self._serve_waiting()
        if self._flight.flight_state is not None:
            self._watch()
            self._tick(self._flight.flight_state)
        self._set_pace()

    def _has_all_evidence(self):
        is_blind = self._parameters.state_topic is None
        has_position = is_blind or self._measured_position() is not None
        return self._flight.filter is not NO_FILTER and has_position

    def _recover(self):
        self._recovery_timer.stop()
        flight, position = self._flight, self._measured_position()
        # A takeoff that has waited begins before the first tick.
        flight.time = self._handle.time()
        flight.recover(position, self._parameters.ground)
        self._log_recovery(None if position is None else position[2] - flight.ground)
        self._serve_waiting()

    def _watch(self):
        """End a flight that is over; land one that cannot go on."""
        checks, now, flight = self._checks, self._handle.time(), self._flight
        self._ran += min(max(now - self._watched, 0.0), CRUISE_TIME_STEP)
        self._watched = now
        if complaint := checks.battery_complaint(now):
            self._handle.warn(complaint, throttle=30.0, key="battery")
        rows = [row for row in WATCH if flight.state in row.phases]
        if found := first_firing(rows, self._firing, self._ran, checks, flight):
            row, reason = found
            self._end(row.next, row.says.format(reason))

    def _end(self, event, reason, failure=""):
        """Land, or end a flight that is over."""
        if self._flight.accepts(event):
            text = "takeoff aborted" if event is Request.LAND else "the flight was ended"
            self._answer(f"{text}: {failure or reason}")
            self._flight.request(event)
            self._reason = reason

    def _tick(self, before):
        now, motion = self._handle.time(), self._checks.measured.within(self._handle.time())
        z_dot = None if motion is None else motion.velocity[2]
        output = self._flight.tick(now, self._measured_position(), z_dot)
        state = self._flight.flight_state
        if before is FlightState.TAKING_OFF and state is FlightState.LANDING:
            self._reason = "the vehicle has not lifted off"
            self._answer(f"takeoff aborted: {self._reason}; can it fly?")
        elif before in _TAKES_OFF and state is FlightState.ON_GROUND:
            self._reason = self._flight.filter.reason
            self._answer(_ENDED.format(self._reason))
        if state is not None and state is not self._state:
            self._publish_state(state)
        if output.toggle:
            self._in_flight.publish(Empty())
        if output.hover_thrust is not None:
            self._hover_thrust.publish(Float64(output.hover_thrust))
        if output.reference is not None:
            reference = from_vector(PositionVelocityState, output.reference)
            message = stamped(PositionVelocityStateStamped, self._handle.stamp(), state=reference)
            self._reference.publish(message)
            if state is FlightState.DESCENDING:
                self._descent.publish(message)
        if output.thrust is not None:
            control = from_vector(Control, (0.0, 0.0, 0.0, output.thrust))
            self._control.publish(stamped(ControlStamped, self._handle.stamp(), control=control))
        if state is FlightState.ON_GROUND:
            self._answer()
        elif state is FlightState.FLYING and not self._under_way.done():
            if (distance := self._flight.arrival()) is not None:
                self._answer()
                if distance > ARRIVED:
                    self._handle.info(
                        f"the vehicle is in flight, {distance:.2f} m away from the hover point "
                        f"{self._flight.plan.hover}; has its controller another reference?"
                    )

    def _set_pace(self):
        # Not before the state has been published.
        state = self._flight.flight_state
        period = TIME_STEP
        if state is self._state and not self._waiting:
            if state is FlightState.FLYING:
                period = CRUISE_TIME_STEP
            elif state is FlightState.ON_GROUND:
                period = GROUND_TIME_STEP
        self._timer.set_period(period)

    # The status.

    def _takeoff_refusal(self):
        """Return why the vehicle must not take off from the ground; empty if it may."""
        # Another vehicle of the process may be landing, and the process end with that flight.
        if self._handle.is_ending:
            return f"{self._handle.name} is to end"
        return self._checks.refusal(self._handle.time(), self._flight.filter)

    def _log_recovery(self, height):
        """Log the state in which the server begins, and the evidence; ``height`` in m or None."""
        report, state = self._flight.filter, self._flight.flight_state
        if state is None:
            return
        if report.state is FilterState.SINKING:
            evidence = "the filter brings the vehicle down"
        elif report.takes_over:
            evidence = "the filter has stopped the motors"
        else:
            remembered = "nothing" if report.remembered is None else report.remembered.word
            seen = "not known" if height is None else f"{height:.2f} m"
            evidence = f"{remembered} is remembered, the height is {seen}"
        self._handle.info(f"begins {state.word}: {evidence}")
        self._logged_word = _LOG_WORDS[state]

    def _publish_state(self, state):
        """Publish a new state; log it, with its reason if that is new."""
        self._state = state
        # The filter logs its own reasons.
        report = self._flight.filter
        reason = "" if self._reason in (report.reason, report.refusal) else self._reason
        if (word := _LOG_WORDS[state]) != self._logged_word:
            is_new = reason and reason != self._logged_reason
            self._handle.info(f"{word}: {reason}" if is_new else word)
            self._logged_word, self._logged_reason = word, reason
        self._inhibit_shutdown(state is not FlightState.ON_GROUND)
        self._publish_status()

    def _publish_status(self):
        """Publish the status, typed and as text, if it has changed."""
        content = self._content()
        if content == self._published:
            return
        state, reason, refusal = content
        # Nothing while the state is not known.
        if state is not None and state is self._state:
            self._published = content
            status = stamped(FlightStatus, self._handle.stamp(), state=state, reason=reason)
            status.takeoff_refusal, status.ground = refusal, self._flight.ground
            self._status.publish(status)
        if (text := _text(*content)) != self._published_text:
            self._published_text = text
            self._text.publish(String(text))

    def _publish_diagnostics(self):
        if not self._diagnostics.has_subscribers():
            return
        checks, filter_state = self._checks, self._flight.filter.state
        text = _text(*self._content())
        level = flight_topics.WARN if ": " in text else flight_topics.OK
        if filter_state in (FilterState.SINKING, FilterState.EMERGENCY):
            level = flight_topics.ERROR
        figures = {
            "state is fresh": str(checks.measured.position(self._handle.time()) is not None),
            "controller": str(checks.has_controller),
            "battery (V)": f"{checks.battery.voltage:.2f}",
        }
        self._diagnostics.publish(flight_topics.report(self._handle, level, text, figures))

    def _content(self):
        """Return flight state, reason, and why a takeoff is refused."""
        state, report = self._flight.flight_state, self._flight.filter
        if state is not FlightState.ON_GROUND:
            is_held = report.state is FilterState.HOLDING and state is not None
            reasons = (self._reason, report.reason if is_held else "")
            return state, "; ".join(filter(None, reasons)), REFUSALS[state]
        return state, self._reason, self._takeoff_refusal()


def _text(state, reason, refusal):
    words = "looking for the state of the flight" if state is None else state.word.replace("_", " ")
    if state is FlightState.ON_GROUND and refusal:
        reason = "; ".join(filter(None, (reason, f"takeoff refused: {refusal}")))
    return ": ".join(filter(None, (words, reason)))
