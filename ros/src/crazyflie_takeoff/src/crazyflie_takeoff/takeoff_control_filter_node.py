"""ROS interface of the filter between takeoff control and commanded control."""

import math
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Empty, Float64, Header
from std_srvs.srv import Empty as EmptyService
from typing_extensions import override

from crazyflie_model.limits import MAX_THRUST, MIN_THRUST
from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    EstimateStatus,
    FilterStatus,
    FlightStatus,
    PositionVelocityYawStateStamped,
)
from crazyflie_takeoff import flight_topics, supervisor
from crazyflie_takeoff.envelope import Limits
from crazyflie_takeoff.facts import Facts, Timeouts
from crazyflie_takeoff.fallback import SafeSetpoint
from crazyflie_takeoff.flight_topics import FlightTopicParameters
from crazyflie_takeoff.guards import LISTENING_TIME, Memory
from crazyflie_takeoff.motion import Delay, Motion
from crazyflie_takeoff.phases import FilterState, FlightState, Phase, flight_state
from crazyflie_takeoff.supervisor import Given
from crazyflie_takeoff.vehicle_facts import VehicleFacts
from crazyflie_utils import Node, NodeHandle, ServiceError, parameter, topic
from crazyflie_utils.parameters import vehicle_model
from crazyflie_utils.parameters.types import DURATION, METRES, SERVICE, Number
from crazyflie_utils.parameters.vehicle_model import VEHICLE_MODEL
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.vectors import stamped

TIME_STEP = 0.01  #: Period of the filter's own controls (s).
NOMINAL_TIME_STEP = 0.04  #: Period of the ticks in a nominal flight (s).

SERVER_LIMIT = 2.0  #: Longest time that it waits for a server that recovers the flight state (s).
FRESH_TIME = 5.0  #: Time after the start in which commanded controls do not prove a flight (s).
CONTROLLER_POLL_PERIOD = 0.1  #: Period of the search for publishers of controls (s).
BUSY_PAUSE = 0.1  #: Pause after which the log says that the computer is too busy (s).
REPETITION = 10.0  #: Shortest time between two such messages (s).


class TakeoffControlFilterParameters(FlightTopicParameters):
    """Parameters of `TakeoffControlFilterNode`."""

    takeoff_control_topic: str = topic("takeoff_control", "the takeoff server's control")
    commanded_control_topic: str = topic("commanded_control", "the controller's control")
    final_control_topic: str = topic("final_control", "the control that is passed on")
    all_emergency_topic: str = topic(
        "all_emergency", "stops the motors of all vehicles", "/all/emergency"
    )
    emergency_service: str = parameter(SERVICE, "stops the motors", "/emergency", "srv/emergency")
    reset_service: str = parameter(
        SERVICE, "ends an emergency", "/emergency_reset", "srv/emergency_reset"
    )
    hold: float | None = parameter(
        DURATION,
        "control that is older in flight is replaced; by default after three of the controller's "
        "usual periods, 0.1 s to 0.5 s",
        None,
        "loss/hold_after",
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

    def timeouts(self) -> Timeouts:
        """Return the timeouts of the filter after a loss."""
        return Timeouts(self.hold, self.recovery, self.descent, self.place)

    def limits(self) -> Limits:
        """Return the limits of a flight."""
        box = self.box.without_floor()
        model = vehicle_model.load(self.model)
        ranges = model.tilt_limit, model.yaw_rate_limit, model.thrust_limit
        return Limits(box, self.outside, self.floor, self.climb, self.height, *ranges)


class TakeoffControlFilterNode(Node):
    """Passes on takeoff controls always, and commanded controls in flight; see `supervisor`."""

    needed_in_flight = True

    def __init__(self) -> None:
        self._has_controller = False  # Whether a node publishes commanded controls.
        self._is_fresh = True
        self._state_delay, self._control_delay = Delay(), Delay()
        self._wall_offset = 0.0  # Wall clock minus `handle.time`, as of the last tick (s).
        # Connection of the last commanded control; None if this process has sent it.
        self._connection: Any = self
        self._published: tuple[object, ...] | None = None
        self._text = self._logged_explanation = ""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        parameters = handle.load(TakeoffControlFilterParameters)
        self._parameters = parameters
        has_driver = parameters.vehicle_status_topic is not None
        vehicle = VehicleFacts(parameters.connected_topic, handle.resolve) if has_driver else None
        sees = parameters.state_topic is not None
        self._facts = Facts(parameters.timeouts(), parameters.limits(), sees, vehicle)
        self._memory = Memory()

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._final = handle.publisher(parameters.final_control_topic, ControlStamped)
        self._status = handle.publisher(parameters.filter_status_topic, FilterStatus, latch=True)
        self._diagnostics = handle.publisher("/diagnostics", DiagnosticArray)
        self._publish_status()
        self._advertise(handle, parameters.emergency_service, self._on_emergency)
        self._advertise(handle, parameters.reset_service, self._on_reset)
        handle.subscribe(
            parameters.all_emergency_topic, Empty, lambda _: self._stop("all vehicles were stopped")
        )
        self._server = handle.subscribe(
            parameters.flight_status_topic, FlightStatus, self._on_flight_status
        )
        handle.subscribe(parameters.in_flight_topic, Empty, self._on_toggle)
        handle.subscribe(parameters.hover_thrust_topic, Float64, self._on_hover_thrust)
        if parameters.state_topic is not None:
            handle.subscribe(
                parameters.state_topic,
                PositionVelocityYawStateStamped,
                self._on_measured_state,
                finite="state",
                latest_only=True,
            )
            handle.subscribe(
                parameters.estimate_status_topic, EstimateStatus, self._on_estimate_status
            )
        if parameters.box_topic is not None:
            flight_topics.follow_box(handle, parameters.box_topic, self._facts.set_box)
        if self._facts.vehicle is not None:
            flight_topics.follow_driver(handle, parameters, self._facts.vehicle)
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
        handle.timer(CONTROLLER_POLL_PERIOD, self._look_for_publishers, steady=True, stagger=True)
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
            self._facts.hear_flight(self._handle.time(), state)
            self._notice()

    def _on_toggle(self, _):
        # No toggle restores a flight that has ended.
        if self._memory.phase.follows or self._memory.phase is Phase.HOLDING:
            self._facts.toggled = not self._facts.toggled
            self._notice()

    def _on_hover_thrust(self, message):
        if MIN_THRUST <= message.data <= MAX_THRUST:
            self._facts.set_hover(message.data)

    def _notice(self):
        """Have the next control, or the timer, look at what has come."""
        self._memory.clear_until = -math.inf
        self._report()

    def _on_measured_state(self, message):
        state = message.state
        motion = Motion(
            (state.x, state.y, state.z), (state.x_dot, state.y_dot, state.z_dot), state.yaw
        )
        time = self._handle.time()
        self._follow_clock(time)
        stamp, now = message.header.stamp.to_sec(), time + self._wall_offset
        supervisor.measure(
            self._memory, self._facts, time, motion, self._state_delay.excess(stamp, now, time)
        )

    def _follow_clock(self, time):
        self._wall_offset = self._handle.nanoseconds(time) * 1e-9 - time

    def _on_estimate_status(self, message):
        if message.is_tilted != self._facts.is_tilted:
            self._facts.is_tilted = message.is_tilted
            self._notice()

    def _on_takeoff_control(self, message):
        memory, facts, name = self._memory, self._facts, self._takeoffs.caller(message)
        stands = supervisor.is_on_ground(memory, facts)
        facts.hear_takeoff(self._handle.time(), message, _setpoint(message), name, stands)
        self._publish(supervisor.step(memory, facts, Given.TAKEOFF), message.header.stamp)
        self._report()

    def _on_commanded_control(self, message):
        time, stamp = self._handle.time(), message.header.stamp
        seconds, now = stamp.secs + 1e-9 * stamp.nsecs, time + self._wall_offset
        age = self._control_delay.excess(seconds, now, time)
        connection = getattr(message, "_connection_header", None)
        memory, facts = self._memory, self._facts
        is_same = connection is self._connection
        if is_same and supervisor.passes(memory, facts, time, message.control, age):
            self._final.publish(message)
            return
        self._connection = connection
        name = self._commands.caller(message)
        facts.hear_commanded(time, message, _setpoint(message), name, age)
        self._publish(supervisor.step(memory, facts, Given.COMMANDED), stamp)
        self._report()

    # Emergencies.

    def _on_emergency(self, _):
        self._stop(f"{self._handle.resolve(self._parameters.emergency_service)} was called")

    def _stop(self, reason):
        self._facts.emergency = reason
        self._on_timer()

    def _on_reset(self, _):
        try:
            supervisor.reset(self._memory, self._facts)
        except RefusalError as reason:
            name = self._handle.resolve(self._parameters.reset_service)
            raise ServiceError(f"{name} refused: {reason}") from None
        self._report()

    # Timers.

    def _on_timer(self):
        time = self._handle.time()
        self._follow_clock(time)
        memory, facts = self._memory, self._facts
        was_clear = time < memory.clear_until
        facts.advance(time)
        control = supervisor.step(memory, facts, Given.TIME)
        if was_clear and time < memory.clear_until:
            return
        self._publish(control, self._handle.stamp())
        pause = facts.pauses.longest
        if pause > BUSY_PAUSE:
            self._handle.warn(
                f"this computer is too busy: the filter has not run for {pause:.2f} s; expected "
                f"every {NOMINAL_TIME_STEP:g} s. Controls are kept near hover meanwhile",
                throttle=REPETITION,
                key="busy",
            )
        self._report()

    def _set_pace(self):
        # A nominal tick leaves time for quick ones before the takeover.
        nominal = max(TIME_STEP, min(NOMINAL_TIME_STEP, 0.4 * self._facts.hold))
        is_nominal = supervisor.may_look_rarely(self._memory, self._facts)
        self._timer.set_period(nominal if is_nominal else TIME_STEP)

    def _stop_listening(self):
        # A server that recovers the flight state publishes it soon.
        if self._facts.remembered is not None or not self._server.has_publishers():
            self._stop_waiting()

    def _stop_waiting(self):
        self._listening_timer.stop()
        self._server_timer.stop()
        facts = self._facts
        facts.advance(self._handle.time())
        facts.has_listened = True
        # The last control has waited.
        waits = self._memory.phase is Phase.LISTENING and facts.is_commanded
        given = Given.COMMANDED if waits else Given.TIME
        self._publish(supervisor.step(self._memory, facts, given), self._handle.stamp())
        self._report()

    def _end_freshness(self):
        self._fresh_timer.stop()
        self._is_fresh = False
        self._report()

    # Outputs.

    def _publish(self, control, stamp):
        if isinstance(control, SafeSetpoint):
            control = stamped(ControlStamped, stamp, control=Control(*control))
        if control is not None:
            self._final.publish(control)

    def _look_for_publishers(self):
        facts, self._has_controller = self._facts, self._commands.has_publishers()
        if not self._has_controller:
            # The next one is new.
            facts.controller_failed = -math.inf
        # A server that looks for the state of the flight says it soon.
        looks = facts.flight is None and self._server.has_publishers()
        if looks or not self._takeoffs.has_publishers():
            facts.server_missed = facts.ran
            self._memory.clear_until = -math.inf
        self._publish_status()

    def _report(self):
        self._publish_status()
        self._set_pace()

    def _publish_status(self):
        content = self._content()
        if content == self._published:
            return
        self._published = content
        status = FilterStatus(Header(stamp=self._handle.stamp()), *content)
        self._status.publish(status)
        self._text, explanation = status_text(status), status.takeoff_refusal or status.reason
        # Only once, however the flight state changes meanwhile.
        if explanation not in ("", self._logged_explanation):
            self._handle.warn(self._text)
        self._logged_explanation = explanation

    def _content(self):
        """Return the fields of the status, in the order of the message."""
        memory, facts = self._memory, self._facts
        # Commanded controls right after a launch do not prove a flight.
        is_commanded = facts.is_commanded and not self._is_fresh
        refusal = supervisor.takeoff_refusal(memory, facts)
        has_controller = self._has_controller and not facts.lacks_controller
        flight_state = facts.remembered or FlightStatus.UNKNOWN
        state = memory.phase.state
        return state, memory.reason, refusal, flight_state, is_commanded, has_controller

    def _publish_diagnostics(self):
        if not self._diagnostics.has_subscribers():
            return
        memory, facts = self._memory, self._facts
        state = memory.phase.state
        level = flight_topics.ERROR if state >= FilterState.SINKING else flight_topics.WARN
        is_acknowledged = facts.remembered is FlightState.ON_GROUND
        if memory.phase.follows or (memory.phase is Phase.DOWN and is_acknowledged):
            level = flight_topics.OK
        figures = {
            "takeovers": str(memory.takeovers),
            "hover thrust (m/s^2)": f"{facts.hover:.2f}",
            "age of the commanded control (s)": f"{max(facts.silence, 0.0):.2f}",
        }
        self._diagnostics.publish(flight_topics.report(self._handle, level, self._text, figures))


def _setpoint(message):
    c = message.control
    return SafeSetpoint(c.roll, c.pitch, c.yaw_dot, c.thrust)


def status_text(status: FilterStatus) -> str:
    """Return a status as text, such as "sinking from flying: no control comes"."""
    words = []
    if status.takeoff_refusal:
        words.append("refusing")
    elif status.state > FilterState.HOLDING:
        words.append(FilterState(status.state).name.lower())
    if status.flight_state:
        words.append(FlightState(status.flight_state).word)
    state = " from ".join(words) or ("commanded" if status.is_commanded else "unknown")
    return ": ".join(filter(None, (state, status.takeoff_refusal or status.reason)))
