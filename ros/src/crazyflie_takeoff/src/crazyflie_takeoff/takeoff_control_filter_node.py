"""ROS interface of the filter between takeoff control and commanded control."""

from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Bool, Empty, String
from std_srvs.srv import Empty as EmptyService
from typing_extensions import override

from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    FilterStatus,
    FlightStatus,
    PositionVelocityYawStateStamped,
)
from crazyflie_takeoff import flight_topics
from crazyflie_takeoff.filter_machine import FilterMachine, FilterState, LossTimeouts, Status
from crazyflie_takeoff.flight_topics import FlightTopicParameters, derived_topic, named_after
from crazyflie_takeoff.limits import Limits
from crazyflie_takeoff.motion import Delay, Motion
from crazyflie_takeoff.safe_control import SafeSetpoint
from crazyflie_takeoff.transition_table import FlightState, flight_state
from crazyflie_takeoff.vehicle_facts import VehicleFacts
from crazyflie_utils import Node, NodeHandle, ServiceError, parameter, topic
from crazyflie_utils.parameters import vehicle_model
from crazyflie_utils.parameters.types import DURATION, METRES, SERVICE, Number
from crazyflie_utils.parameters.vehicle_model import VEHICLE_MODEL
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.vectors import stamped

TIME_STEP = 0.01  #: Period of the filter's own controls (s).
NOMINAL_TIME_STEP = 0.04  #: Period of the ticks in a nominal flight (s).

#: Time that a filter listens when it starts, before it passes commanded controls (s): some periods
#: of the zero thrust on the ground, and less than a vehicle flies on without controls.
LISTENING_TIME = 0.4
SERVER_LIMIT = 2.0  #: Longest time that it waits for a server that recovers the flight state (s).
FRESH_TIME = 5.0  #: Time after the start in which commanded controls do not prove a flight (s).
CONTROLLER_POLL_PERIOD = 0.1  #: Period of the search for publishers of controls (s).
BUSY_GAP = 0.1  #: Gap after which the log says that the computer is too busy (s).
REPETITION = 10.0  #: Shortest time between two such messages (s).


class TakeoffControlFilterParameters(FlightTopicParameters):
    """Parameters of `TakeoffControlFilterNode`."""

    takeoff_control_topic: str = topic("takeoff_control", "the takeoff server's control")
    commanded_control_topic: str = topic("commanded_control", "the controller's control")
    final_control_topic: str = topic("final_control", "the control that is passed on")
    state_topic: str | None = topic(
        "state", "where the vehicle is; without it the limits are not watched", None
    )
    own_tilted_topic: str | None = named_after("state", "_tilted")
    all_emergency_topic: str = topic(
        "all_emergency", "stops the motors of all vehicles", "/all/emergency"
    )
    emergency_service: str = parameter(SERVICE, "stops the motors", "/emergency", "srv/emergency")
    reset_service: str = parameter(
        SERVICE, "ends an emergency", "/emergency_reset", "srv/emergency_reset"
    )
    hold: float = parameter(
        DURATION, "control that is older in flight is replaced", 0.1, "loss/hold_after"
    )
    recovery: float = parameter(
        DURATION,
        "time until the descent after that, while no state comes either",
        1.5,
        "loss/return_limit",
    )
    place: float = parameter(
        DURATION, "the same in flight while states come", 3.0, "loss/place_limit"
    )
    descent: float = parameter(
        DURATION,
        "the motors are stopped this long after the descent has begun; later by the time to "
        "sink when the height is known",
        5.0,
        "loss/descent_limit",
    )
    floor: float = parameter(METRES, "lowest z; lower is below the ground", -0.5, "limits/floor")
    outside: float = parameter(
        Number("m", minimum=0.0), "largest distance outside the geofence", 0.5, "limits/outside"
    )
    climb: float = parameter(
        Number("m/s", above=0.0), "largest speed of a climb by controls", 3.0, "limits/climb"
    )
    height: float = parameter(
        Number("m", above=0.0),
        "largest height above the ground of a climb by controls",
        10.0,
        "limits/height",
    )

    model: str = parameter(
        VEHICLE_MODEL,
        "type of the vehicle, or model file: controls are limited to its `limits`",
        "cf21",
    )

    tilted_topic = derived_topic("tilted", "state", "_tilted")

    def timeouts(self) -> LossTimeouts:
        """Return the timeouts of the filter after a loss."""
        return LossTimeouts(self.hold, self.recovery, self.descent, self.place)

    def limits(self) -> Limits:
        """Return the limits of a flight."""
        box = self.box.without_floor()
        model = vehicle_model.load(self.model)
        ranges = model.tilt_limit, model.yaw_rate_limit, model.thrust_limit
        return Limits(box, self.outside, self.floor, self.climb, self.height, *ranges)


class TakeoffControlFilterNode(Node):
    """Passes on takeoff controls always, and commanded controls in flight; see `FilterMachine`."""

    needed_in_flight = True

    def __init__(self) -> None:
        self._published_controller: bool | None = None
        self._is_fresh = True
        self._state_delay, self._control_delay = Delay(), Delay()
        self._wall_offset = 0.0  # Wall clock minus `handle.time`, as of the last tick (s).
        # Connection of the last commanded control; None if this process has sent it.
        self._connection: Any = self
        self._is_settled = False  # Whether the status of a nominal flight has been published.
        self._status: Status | None = None  # As it was published last.
        self._text = self._logged_explanation = ""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        parameters = handle.load(TakeoffControlFilterParameters)
        self._parameters = parameters
        self._vehicle = VehicleFacts(parameters.connected_topic, handle.resolve)
        self._has_driver = parameters.vehicle_status_topic is not None
        self._filter: FilterMachine[ControlStamped] = FilterMachine(
            parameters.timeouts(), parameters.limits(), parameters.state_topic is not None
        )

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._final = handle.publisher(parameters.final_control_topic, ControlStamped)
        self._text_status = handle.publisher(parameters.filter_state_topic, String, latch=True)
        self._typed_status = handle.publisher(
            parameters.filter_status_topic, FilterStatus, latch=True
        )
        self._diagnostics = handle.publisher("/diagnostics", DiagnosticArray)
        self._controller = handle.publisher(parameters.controller_topic, Bool, latch=True)
        self._publish_state()
        self._advertise(handle, parameters.emergency_service, self._on_emergency)
        self._advertise(handle, parameters.reset_service, self._on_reset)
        handle.subscribe(
            parameters.all_emergency_topic, Empty, lambda _: self._stop("all vehicles were stopped")
        )
        self._server = handle.subscribe(
            parameters.flight_status_topic, FlightStatus, self._on_flight_status
        )
        handle.subscribe(parameters.in_flight_topic, Empty, self._on_toggle)
        if parameters.state_topic is not None:
            handle.subscribe(
                parameters.state_topic,
                PositionVelocityYawStateStamped,
                self._on_measured_state,
                finite="state",
                latest_only=True,
            )
        if parameters.tilted_topic is not None:
            handle.subscribe(parameters.tilted_topic, Bool, self._on_tilted)
        if parameters.box_topic is not None:
            flight_topics.follow_box(handle, parameters.box_topic, self._filter.set_box)
        flight_topics.follow_driver(handle, parameters, self._vehicle)
        self._takeoffs = handle.subscribe(
            parameters.takeoff_control_topic,
            ControlStamped,
            self._on_takeoff_control,
            finite="control",
        )
        self._commands = handle.subscribe(
            parameters.commanded_control_topic,
            ControlStamped,
            self._on_commanded_control,
            finite="control",
        )
        self._timer = handle.timer(TIME_STEP, self._on_timer)
        # Connections are made in real time, also where time is simulated.
        self._listening_timer = handle.timer(LISTENING_TIME, self._stop_listening, steady=True)
        self._server_timer = handle.timer(SERVER_LIMIT, self._stop_waiting, steady=True)
        self._fresh_timer = handle.timer(FRESH_TIME, self._end_freshness, steady=True)
        handle.timer(CONTROLLER_POLL_PERIOD, self._publish_controller, steady=True, stagger=True)
        period = flight_topics.DIAGNOSTICS_PERIOD
        handle.timer(period, self._publish_diagnostics, steady=True, stagger=True)

    def _advertise(self, handle, service, callback):
        name = handle.resolve(service)
        others = handle.service_nodes()
        if others.get(name, handle.name) != handle.name:
            handle.warn(
                f"{name} is also a service of {others[name]}: the last one to start answers; give "
                "this vehicle a name of its own for it"
            )
        try:
            handle.advertise_service(service, EmptyService, callback)
        except ServiceError:
            # There are two vehicles in this process; /all/emergency stops both.
            handle.warn(f"{name} stops another vehicle, not this one")

    # Inputs.

    def _on_flight_status(self, message):
        try:
            state = flight_state(message.state)
        except ValueError:
            self._handle.warn(
                f"ignoring state {message.state} on {self._parameters.flight_status_topic}; "
                "expected a constant of FlightStatus",
                throttle=1.0,
                key="flight state",
            )
            return
        if state is not None:
            self._filter.flight_state = state
            self._follow_filter()

    def _on_toggle(self, _):
        self._filter.toggle()
        self._follow_filter()

    def _on_measured_state(self, message):
        state = message.state
        motion = Motion(
            (state.x, state.y, state.z), (state.x_dot, state.y_dot, state.z_dot), state.yaw
        )
        time = self._handle.time()
        self._follow_clock(time)
        stamp, now = message.header.stamp.to_sec(), time + self._wall_offset
        self._filter.measure(motion, self._state_delay.excess(stamp, now, time))

    def _follow_clock(self, time):
        self._wall_offset = self._handle.nanoseconds(time) * 1e-9 - time

    def _on_tilted(self, message):
        self._filter.set_tilted(message.data)
        self._set_pace()

    def _on_takeoff_control(self, message):
        now, caller = self._handle.time(), self._takeoffs.caller(message)
        chosen = self._filter.takeoff(now, message, _setpoint(message), caller)
        self._publish(chosen, message.header.stamp)
        self._follow_filter()

    def _on_commanded_control(self, message):
        time, stamp = self._handle.time(), message.header.stamp
        seconds, now = stamp.secs + 1e-9 * stamp.nsecs, time + self._wall_offset
        age = self._control_delay.excess(seconds, now, time)
        connection = getattr(message, "_connection_header", None)
        is_same = connection is self._connection
        if is_same and self._filter.pass_unchanged(time, message.control, age):
            self._final.publish(message)
            return
        self._connection = connection
        caller = self._commands.caller(message)
        chosen = self._filter.commanded(time, message, _setpoint(message), caller, age)
        self._publish(chosen, stamp)
        self._publish_state()

    # Emergencies.

    def _on_emergency(self, _):
        self._stop(f"{self._handle.resolve(self._parameters.emergency_service)} was called")

    def _stop(self, reason):
        self._filter.stop(reason)
        self._on_timer()

    def _on_reset(self, _):
        try:
            self._filter.reset()
        except RefusalError as reason:
            name = self._handle.resolve(self._parameters.reset_service)
            raise ServiceError(f"{name} refused: {reason}") from None
        self._publish_state()

    # Timers.

    def _on_timer(self):
        time = self._handle.time()
        self._follow_clock(time)
        if self._has_driver:
            is_airborne = not self._filter.is_on_ground
            if reason := self._vehicle.flight_end(time, is_airborne):
                self._filter.lose_vehicle(reason)
        if (control := self._filter.tick(time)) is not None:
            self._publish(control, self._handle.stamp())
        gap = self._filter.relay.gaps.longest
        if gap > BUSY_GAP:
            self._handle.warn(
                f"this computer is too busy: the filter has not run for {gap:.2f} s; expected "
                f"every {NOMINAL_TIME_STEP:g} s. Controls are kept near hover meanwhile",
                throttle=REPETITION,
                key="busy",
            )
        self._follow_filter()

    def _follow_filter(self):
        was_settled, self._is_settled = self._is_settled, self._filter.passes_unchanged
        if not (was_settled and self._is_settled):
            self._publish_state()
            self._set_pace()

    def _set_pace(self):
        # A nominal tick leaves time for quick ones before the takeover.
        nominal = max(TIME_STEP, min(NOMINAL_TIME_STEP, 0.4 * self._parameters.hold))
        self._timer.set_period(nominal if self._filter.is_nominal else TIME_STEP)

    def _stop_listening(self):
        # A server that recovers the flight state publishes it soon.
        if self._filter.remembered is not None or not self._server.has_publishers():
            self._stop_waiting()

    def _stop_waiting(self):
        self._listening_timer.stop()
        self._server_timer.stop()
        self._publish(self._filter.stop_listening(self._handle.time()), self._handle.stamp())

    def _end_freshness(self):
        self._fresh_timer.stop()
        self._is_fresh = False
        self._publish_state()

    # Outputs.

    def _publish(self, control, stamp):
        if isinstance(control, SafeSetpoint):
            control = stamped(ControlStamped, stamp, control=Control(*control))
        if control is not None:
            self._final.publish(control)

    def _publish_controller(self):
        machine, is_there = self._filter, self._commands.has_publishers()
        if not is_there:
            machine.miss_controller()
        if not self._takeoffs.has_publishers():
            machine.miss_server()
        has_controller = is_there and not machine.lacks_controller
        if has_controller != self._published_controller:
            self._published_controller = has_controller
            self._controller.publish(Bool(has_controller))

    def _publish_state(self):
        status = self._filter.status
        if self._is_fresh and status.is_commanded:
            # Commanded controls right after a launch do not prove a flight.
            status = status._replace(is_commanded=False)
        if status == self._status:
            return
        self._status = status
        message = stamped(FilterStatus, self._handle.stamp(), **status._asdict())
        message.flight_state = status.flight_state or FlightStatus.UNKNOWN
        self._typed_status.publish(message)
        explanation = status.takeoff_refusal or status.reason
        text = ": ".join(filter(None, (_words(status), explanation)))
        if text == self._text:
            return
        self._text = text
        self._text_status.publish(String(text))
        # Only once, however the flight state changes meanwhile.
        if explanation not in ("", self._logged_explanation):
            self._handle.warn(text)
        self._logged_explanation = explanation

    def _publish_diagnostics(self):
        if not self._diagnostics.has_subscribers():
            return
        machine = self._filter
        level = flight_topics.ERROR if machine.state.passes_nothing else flight_topics.WARN
        is_acknowledged = machine.remembered is FlightState.ON_GROUND
        is_down = machine.state is FilterState.DOWN
        if machine.state is FilterState.PASSING or (is_down and is_acknowledged):
            level = flight_topics.OK
        figures = {
            "takeovers": str(machine.takeovers),
            "hover thrust (m/s^2)": f"{machine.relay.hover:.2f}",
            "age of the commanded control (s)": f"{max(machine.silence, 0.0):.2f}",
        }
        self._diagnostics.publish(flight_topics.report(self._handle, level, self._text, figures))


def _setpoint(message):
    c = message.control
    return SafeSetpoint(c.roll, c.pitch, c.yaw_dot, c.thrust)


def _words(status):
    """Return the state as text, such as "sinking from flying"."""
    words = []
    if status.takeoff_refusal:
        words.append("refusing")
    elif status.state not in (FilterState.PASSING, FilterState.HOLDING):
        words.append(status.state.name.lower())
    if status.flight_state is not None:
        words.append(status.flight_state.word)
    return " from ".join(words) or ("commanded" if status.is_commanded else "unknown")
