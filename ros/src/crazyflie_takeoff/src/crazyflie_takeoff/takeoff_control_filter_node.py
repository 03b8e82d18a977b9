"""ROS interface of the choice between takeoff control and commanded control."""

from std_msgs.msg import Bool, Empty
from std_srvs.srv import Empty as EmptyService
from std_srvs.srv import EmptyResponse
from typing_extensions import override

from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    FlightStatus,
    PositionVelocityYawStateStamped,
)
from crazyflie_takeoff import diagnostics
from crazyflie_takeoff.fence_box import follow_box
from crazyflie_takeoff.filter_status_publisher import FilterStatusPublisher
from crazyflie_takeoff.flight_state import flight_state
from crazyflie_takeoff.motion import Delay, Motion
from crazyflie_takeoff.safe_control import Setpoint
from crazyflie_takeoff.safe_filter import SafeFilter
from crazyflie_takeoff.takeoff_control_filter_parameters import TakeoffControlFilterParameters
from crazyflie_utils import Node, NodeHandle, ServiceError
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.vectors import stamped

TIME_STEP = 0.01  #: Period of the controls that the filter makes itself, s.
NOMINAL_TIME_STEP = 0.04  #: The same while nothing is wrong, s.

#: How long a filter that has started listens before it passes a controller, s: some periods of the
#: zero thrust on the ground, and less than a vehicle flies on without controls.
LISTENING_TIME = 0.4

SERVER_LIMIT = 2.0  #: How long it waits for the flight state of a server that still recovers it, s.
#: How long after its start a filter does not take commands for a sign of flight, s.
FRESH_TIME = 5.0
CONTROLLER_POLL_PERIOD = 0.1  #: Between two looks for publishers of commanded controls, s.
BUSY_GAP = 0.1  #: The computer of a filter that does not run for this long, s, is too busy.
REPETITION = 10.0  #: Shortest time between two warnings of the same kind, s.


class TakeoffControlFilterNode(Node):
    """Pass on takeoff control always, and commanded control in flight; see `SafeFilter`."""

    needed_in_flight = True

    def __init__(self) -> None:
        self._published_controller: bool | None = None
        self._is_fresh = True
        self._state_delay, self._control_delay = Delay(), Delay()

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        parameters = handle.load(TakeoffControlFilterParameters)
        self._parameters = parameters
        self._filter: SafeFilter[ControlStamped] = SafeFilter(
            parameters.timeouts(), parameters.limits(), parameters.state_topic is not None
        )

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._final = handle.publisher(parameters.final_control_topic, ControlStamped)
        self._status = FilterStatusPublisher(handle, parameters)
        self._controller = handle.publisher(parameters.controller_topic, Bool, latch=True)
        self._publish_state()
        self._advertise(handle, parameters.emergency_service, self._on_emergency)
        self._advertise(handle, parameters.reset_service, self._on_reset)
        handle.subscribe(parameters.all_emergency_topic, Empty, self._on_all_emergency)
        self._server = handle.subscribe(
            parameters.flight_status_topic, FlightStatus, self._on_flight_status
        )
        handle.subscribe(parameters.in_flight_topic, Empty, self._on_toggle)
        self._subscribe_measurements(handle)
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
        self._register_timers(handle)

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
            # Two vehicles in one process. What stops all of them still works.
            handle.warn(f"{name} stops another vehicle, not this one")

    def _subscribe_measurements(self, handle):
        parameters = self._parameters
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
            follow_box(handle, parameters.box_topic, self._on_box)

    def _register_timers(self, handle):
        self._timer = handle.varying_timer(TIME_STEP, self._on_timer)
        # Whether connections come about has nothing to do with simulated time.
        self._listening_timer = handle.timer(LISTENING_TIME, self._stop_listening, steady=True)
        self._server_timer = handle.timer(SERVER_LIMIT, self._stop_waiting, steady=True)
        self._fresh_timer = handle.timer(FRESH_TIME, self._end_freshness, steady=True)
        handle.timer(CONTROLLER_POLL_PERIOD, self._publish_controller, steady=True, stagger=True)
        handle.timer(diagnostics.PERIOD, self._publish_diagnostics, steady=True, stagger=True)

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
            self._filter.choice.state = state
            self._follow_filter()

    def _on_toggle(self, _):
        self._filter.toggle()
        self._follow_filter()

    def _on_measured_state(self, message):
        state = message.state
        motion = Motion(
            (state.x, state.y, state.z), (state.x_dot, state.y_dot, state.z_dot), state.yaw
        )
        self._filter.relay.measure(motion, self._excess(self._state_delay, message))

    def _excess(self, delay, message):
        time = self._handle.time()
        now = self._handle.nanoseconds(time) * 1e-9
        return delay.excess(message.header.stamp.to_sec(), now, time)

    def _on_box(self, box):
        self._filter.watch.walls.change(box.without_floor())

    def _on_tilted(self, message):
        self._filter.watch.is_tilted = message.data
        self._set_pace()

    def _on_takeoff_control(self, message):
        now, caller = self._handle.time(), self._takeoffs.caller(message)
        chosen = self._filter.takeoff(now, message, _setpoint(message), caller)
        self._publish(chosen, message.header.stamp)
        self._follow_filter()

    def _on_commanded_control(self, message):
        now, caller = self._handle.time(), self._commands.caller(message)
        age = self._excess(self._control_delay, message)
        chosen = self._filter.commanded(now, message, _setpoint(message), caller, age)
        self._publish(chosen, message.header.stamp)
        self._publish_state()

    # Emergencies.

    def _on_emergency(self, _):
        self._stop(f"{self._handle.resolve(self._parameters.emergency_service)} was called")
        return EmptyResponse()

    def _on_all_emergency(self, _):
        self._stop("all vehicles were stopped")

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
        return EmptyResponse()

    # Timers.

    def _on_timer(self):
        self._publish(self._filter.tick(self._handle.time()), self._handle.stamp())
        gap = self._filter.longest_gap
        if gap > BUSY_GAP:
            self._handle.warn(
                f"this computer is too busy: the filter has not run for {gap:.2f} s; expected "
                f"every {NOMINAL_TIME_STEP:g} s. Controls are kept near hover meanwhile",
                throttle=REPETITION,
                key="busy",
            )
        self._follow_filter()

    def _follow_filter(self):
        self._publish_state()
        self._set_pace()

    def _set_pace(self):
        # With time enough to be quick again before the vehicle is taken over.
        nominal = max(TIME_STEP, min(NOMINAL_TIME_STEP, 0.4 * self._parameters.hold))
        self._timer.set_period(nominal if self._filter.is_nominal else TIME_STEP)

    def _stop_listening(self):
        # A server that recovers the state of the flight soon publishes it.
        if self._filter.choice.remembered is not None or not self._server.has_publishers():
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
        if isinstance(control, Setpoint):
            control = stamped(ControlStamped, stamp, control=Control(*control))
        if control is not None:
            self._final.publish(control)

    def _publish_controller(self):
        machine, is_there = self._filter.machine, self._commands.has_publishers()
        if not is_there:
            # The next one is new.
            machine.lacks_controller = False
        if not self._takeoffs.has_publishers():
            machine.may_lack_reference = True
        has_controller = is_there and not machine.lacks_controller
        if has_controller != self._published_controller:
            self._published_controller = has_controller
            self._controller.publish(Bool(has_controller))

    def _publish_state(self):
        status = self._filter.status
        # Commands that come right after a launch are no sign of a flight.
        is_commanded = status.is_commanded and not self._is_fresh
        self._status.publish(status._replace(is_commanded=is_commanded))

    def _publish_diagnostics(self):
        self._status.publish_diagnostics(self._filter)


def _setpoint(message):
    c = message.control
    return Setpoint(c.roll, c.pitch, c.yaw_dot, c.thrust)
