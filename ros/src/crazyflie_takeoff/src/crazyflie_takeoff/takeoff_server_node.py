"""ROS interface of takeoff and landing."""

from concurrent.futures import Future

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Bool, Empty, Float32, String
from std_srvs.srv import Empty as EmptyService
from std_srvs.srv import EmptyResponse
from typing_extensions import override

from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_takeoff import diagnostics
from crazyflie_takeoff.battery import Charge
from crazyflie_takeoff.calls import Calls
from crazyflie_takeoff.driver_connection import DriverConnection
from crazyflie_takeoff.fence_box import follow_box
from crazyflie_takeoff.filter_report import NO_FILTER, parse
from crazyflie_takeoff.flight import FlightStateMachine
from crazyflie_takeoff.flight_log import FlightLog
from crazyflie_takeoff.flight_state import SEPARATOR, FlightState, Takeover
from crazyflie_takeoff.measured_position import MeasuredPosition
from crazyflie_takeoff.recovery import recover_state
from crazyflie_takeoff.takeoff_server_parameters import TakeoffServerParameters, hover_complaint
from crazyflie_utils import Node, NodeHandle, ParameterError, ServiceError
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.vectors import from_vector, stamped

TIME_STEP = 0.01
"""Period of the server, s."""

CRUISE_TIME_STEP = 0.1
"""The same while it leaves the vehicle to the controller and only watches the battery, s."""

STATUS_PERIOD = 0.1
"""How often it is looked whether there is anything new to tell people, s."""

RECOVERY_LIMIT = 1.0
"""How long a server that has started looks for the state of the flight, s."""

LEAVE_LIMIT = 7.0
"""How long the descent may take of a server whose process is to end, s: what it lives on for is
10 s, with the end of the landing."""

START_LIMIT = 5.0
"""How long after the server's start a takeoff waits for the first state and for a
controller, s: nodes that are launched together need a while to find each other."""


class TakeoffServerNode(Node):
    """Let the vehicle take off and land when a service asks for it."""

    needed_in_flight = True

    def __init__(self) -> None:
        # None until it is known where the flight stands.
        self._flight: FlightStateMachine | None = None
        self._is_starting = True
        self._filter_reported = False
        self._filter = NO_FILTER
        self._has_controller = True
        self._had_controller = False
        self._position = MeasuredPosition()
        self._driver = DriverConnection()
        self._published_state: FlightState | None = None
        self._published_status = ""
        self._cause = ""
        self._calls: Calls[EmptyResponse] = Calls()

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(TakeoffServerParameters, self._reconfigure)
        self._battery = self._parameters.battery()
        self._box = self._parameters.box

    def _reconfigure(self, parameters):
        if complaint := hover_complaint(parameters.hover, self._box):
            raise ParameterError(complaint)
        self._parameters = parameters
        if self._flight is not None:
            self._flight.plan = parameters.plan()

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._control = handle.publisher(parameters.control_topic, ControlStamped)
        self._reference = handle.publisher(
            parameters.reference_topic, PositionVelocityStateStamped, latch=True
        )
        self._descent = handle.publisher(parameters.descent_topic, PositionVelocityStateStamped)
        self._in_flight = handle.publisher(parameters.in_flight_topic, Empty)
        self._flight_state = handle.publisher(parameters.flight_state_topic, String, latch=True)
        self._status = handle.publisher(parameters.status_topic, String, latch=True)
        self._diagnostics = handle.publisher("/diagnostics", DiagnosticArray)
        self._announce_flight = handle.inhibit_shutdown()
        handle.advertise_service(parameters.takeoff_service, EmptyService, self._on_takeoff)
        handle.advertise_service(parameters.land_service, EmptyService, self._on_land)
        handle.subscribe(parameters.filter_state_topic, String, self._on_filter_state)
        handle.subscribe(parameters.controller_topic, Bool, self._on_controller)
        if parameters.box_topic is not None:
            follow_box(handle, parameters.box_topic, self._on_box)
        if parameters.battery_topic is not None:
            handle.subscribe(parameters.battery_topic, Float32, self._on_battery)
        if parameters.connected_topic is not None:
            handle.subscribe(parameters.connected_topic, Bool, self._on_connected)
        if parameters.state_topic is not None:
            handle.subscribe(
                parameters.state_topic,
                PositionVelocityYawStateStamped,
                self._on_state,
                finite="state",
                latest_only=True,
            )
        self._timer = handle.varying_timer(TIME_STEP, self._on_timer)
        # Whether connections come about has nothing to do with simulated time.
        self._recovery_timer = handle.timer(RECOVERY_LIMIT, self._recover_state, steady=True)
        self._start_timer = handle.timer(START_LIMIT, self._end_start, steady=True)
        handle.timer(STATUS_PERIOD, self._publish_status, steady=True, stagger=True)
        handle.timer(diagnostics.PERIOD, self._publish_diagnostics, steady=True, stagger=True)

    @override
    def prepare_shutdown(self) -> None:
        """Land: the process is to end."""
        flight = self._flight
        if flight is None or flight.state is FlightState.ON_GROUND:
            return
        if flight.may_land:
            self._calls.fail(ServiceError(f"takeoff aborted: {self._handle.name} is to end"))
            flight.land()
            self._cause = "the launch is to end"
        flight.hurry(LEAVE_LIMIT)
        self._set_pace()

    @override
    def enter_safe_state(self) -> None:
        """End a takeoff with a landing, let a landing go on, and tell the callers."""
        if self._flight is not None:
            self._flight.abort()
        name = self._handle.name
        self._calls.fail_all(ServiceError(f"{name} has failed or is shutting down; see its log"))

    # Services.

    def _on_takeoff(self, _):
        return self._serve(self._parameters.takeoff_service)

    def _on_land(self, _):
        return self._serve(self._parameters.land_service)

    def _serve(self, service):
        future: Future[EmptyResponse] = Future()
        self._calls.wait(service, future)
        self._serve_waiting()
        return future.result() if future.done() else future

    def _serve_waiting(self):
        if self._flight is None:
            return
        for service, future in self._calls.take_waiting():
            if service == self._parameters.takeoff_service and self._lacks_what_may_come():
                self._calls.wait(service, future)
            else:
                self._begin(self._flight, service, future)
        self._set_pace()

    def _lacks_what_may_come(self):
        # What was there and is gone is no matter of waiting.
        lacks_state = self._expects_states and not self._position.is_measured
        lacks_controller = not self._has_controller and not self._had_controller
        lacks = lacks_state or lacks_controller or bool(self._driver_refusal())
        return self._is_starting and lacks

    def _end_start(self):
        self._start_timer.stop()
        self._is_starting = False

    def _begin(self, flight, service, future):
        name = self._handle.resolve(service)
        try:
            if service == self._parameters.takeoff_service:
                flight.check_takeoff()
                if reason := self._takeoff_refusal():
                    raise RefusalError(reason)
                flight.takeoff()
                self._handle.set_param_later("~ground", flight.ground)
            else:
                flight.land()
        except RefusalError as reason:
            future.set_exception(ServiceError(f"{name} refused: {reason}"))
        else:
            self._cause = ""
            self._calls.begin(future, ServiceError(f"takeoff aborted: {name} was called"))

    def _takeoff_refusal(self):
        topic = self._parameters.state_topic
        if self._filter.takeover is Takeover.EMERGENCY:
            return f"emergency, {self._filter.reason}; it has to be reset first"
        if self._filter.takeover is Takeover.REFUSING:
            return self._filter.reason
        if complaint := hover_complaint(self._parameters.hover, self._box):
            return complaint
        if reason := self._driver_refusal():
            return reason
        if topic is not None:
            name = self._handle.resolve(topic)
            if reason := self._position.explanation(self._handle.time(), name):
                return reason
        if not self._has_controller:
            return "no commanded controls come; is the controller running?"
        if self._charge() in (Charge.LOW, Charge.CRITICAL):
            return f"the battery is low, {self._battery.voltage:.2f} V"
        return ""

    def _driver_refusal(self):
        topic = self._parameters.connected_topic
        if topic is None:
            return ""
        return self._driver.refusal(self._handle.time(), self._handle.resolve(topic))

    def _on_connected(self, message):
        self._driver.update(self._handle.time(), message.data)

    # Where the flight stands.

    def _on_filter_state(self, message):
        try:
            report = parse(message.data)
        except ValueError:
            self._handle.warn(
                f"ignoring {message.data!r}, which is no flight state, on "
                f"{self._parameters.filter_state_topic}",
                throttle=1.0,
                key="flight state",
            )
            return
        self._filter_reported = True
        self._filter = report
        if self._flight is not None:
            self._follow_filter(self._flight, report)
            self._set_pace()

    def _follow_filter(self, flight, report):
        flight.is_held = report.is_held
        if report.takeover is None:
            flight.regain()
            return
        # A filter that hears of the takeoff before it is sent its first control is still down.
        is_old = flight.state is FlightState.TAKING_OFF and report.takeover is Takeover.DOWN
        if flight.state is FlightState.ON_GROUND or is_old:
            return
        self._cause = report.reason
        why = ServiceError(f"the flight was ended by the filter: {report.reason}")
        if report.takeover is Takeover.SINKING:
            if flight.state is FlightState.TAKING_OFF:
                self._calls.fail(why)
            flight.lose()
            return
        if report.takeover in (Takeover.EMERGENCY, Takeover.REFUSING):
            self._calls.fail(why)
        flight.end()

    def _on_box(self, box):
        self._box = box

    def _on_controller(self, message):
        self._has_controller = message.data
        self._had_controller = self._had_controller or message.data

    def _on_state(self, message):
        state = message.state
        age = self._handle.age(message.header.stamp)
        self._position.measure(self._handle.time(), (state.x, state.y, state.z), age)

    def _known_position(self):
        return self._position.value(self._handle.time())

    @property
    def _expects_states(self):
        return self._parameters.state_topic is not None

    def _has_all_evidence(self):
        sees_enough = not self._expects_states or self._known_position() is not None
        return self._filter_reported and sees_enough

    def _recover_state(self):
        self._recovery_timer.stop()
        if self._flight is not None:
            return
        plan = self._parameters.plan()
        told = self._filter
        # Without a flight to go on with, the parameter may be of another launch.
        ground = 0.0 if told.remembered is None else self._parameters.ground
        position = self._known_position()
        height = None if position is None else position[2] - ground
        can_descend = plan.descent_speed > 0.0
        recovered = recover_state(
            told.remembered, height, can_descend, told.is_commanded, told.takeover
        )
        self._handle.info(f"begins {recovered.state.value}: {recovered.reason}")
        self._log = FlightLog(self._handle.info, recovered.state)
        self._flight = FlightStateMachine(
            plan, recovered.state, recovered.announced, recovered.is_lost, ground
        )
        self._serve_waiting()

    # The battery.

    def _on_battery(self, message):
        if message.data == message.data:
            self._battery.measure(self._handle.time(), message.data)

    def _charge(self):
        return self._battery.charge(self._handle.time())

    def _watch_battery(self, flight):
        charge = self._charge()
        text = f"the battery is low, {self._battery.voltage:.2f} V"
        if charge in (Charge.LOW, Charge.CRITICAL):
            self._handle.warn(text, throttle=30.0, key="battery")
        if charge is Charge.CRITICAL and flight.may_land:
            self._calls.fail(ServiceError(f"takeoff aborted: {text}"))
            flight.land()
            self._cause = text

    # The flight.

    def _on_timer(self):
        if self._flight is None and self._has_all_evidence():
            self._recover_state()
        if self._calls.has_waiting:
            self._serve_waiting()
        if self._flight is not None:
            self._watch_battery(self._flight)
            takes_off = self._flight.state is FlightState.TAKING_OFF
            output = self._flight.tick(self._handle.time(), self._known_position())
            if takes_off and output.state is FlightState.LANDING:
                self._cause = "the vehicle has not lifted off"
                self._calls.fail(ServiceError(f"takeoff aborted: {self._cause}; can it fly?"))
            self._publish(output)
        self._set_pace()

    def _set_pace(self):
        state = None if self._flight is None else self._flight.state
        # Once the world has been told.
        is_flying = state is FlightState.FLYING and state is self._published_state
        cruises = is_flying and not self._calls.has_waiting
        self._timer.set_period(CRUISE_TIME_STEP if cruises else TIME_STEP)

    def _publish(self, output):
        if output.state is not self._published_state:
            self._published_state = output.state
            # The filter logs its own reasons.
            reason = "" if self._cause == self._filter.reason else self._cause
            self._log.note(output.state, reason)
            self._flight_state.publish(String(output.state.value))
            self._announce_flight(output.state is not FlightState.ON_GROUND)
            self._publish_status()
        if output.toggle:
            self._in_flight.publish(Empty())
        if output.reference is not None:
            state = from_vector(PositionVelocityState, output.reference)
            message = stamped(PositionVelocityStateStamped, self._handle.stamp(), state=state)
            self._reference.publish(message)
            if output.state is FlightState.DESCENDING:
                self._descent.publish(message)
        if output.thrust is not None:
            control = Control(thrust=output.thrust)
            self._control.publish(stamped(ControlStamped, self._handle.stamp(), control=control))
        if output.state.is_settled:
            self._calls.finish(EmptyResponse())

    # What people are told.

    def _status_text(self):
        if self._flight is None:
            return "looking where the flight stands"
        state = self._flight.state
        reasons = [self._cause]
        if state is FlightState.ON_GROUND:
            refusal = self._takeoff_refusal()
            reasons.append(f"takeoff refused: {refusal}" if refusal else "")
        elif self._filter.is_held:
            reasons.append(self._filter.reason)
        words = state.value.replace("_", " ")
        return SEPARATOR.join(filter(None, [words, "; ".join(filter(None, reasons))]))

    def _publish_status(self):
        status = self._status_text()
        if status != self._published_status:
            self._published_status = status
            self._status.publish(String(status))

    def _publish_diagnostics(self):
        status = self._status_text()
        takeover = self._filter.takeover
        has_trouble = SEPARATOR in status
        level = diagnostics.WARN if has_trouble else diagnostics.OK
        if takeover in (Takeover.SINKING, Takeover.EMERGENCY):
            level = diagnostics.ERROR
        figures = {
            "state is fresh": str(self._known_position() is not None),
            "controller": str(self._has_controller),
            "battery (V)": f"{self._battery.voltage:.2f}",
        }
        self._diagnostics.publish(diagnostics.report(self._handle, level, status, figures))
