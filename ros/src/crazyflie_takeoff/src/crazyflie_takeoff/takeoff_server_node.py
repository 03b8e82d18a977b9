"""ROS interface of takeoff and landing."""

from concurrent.futures import Future

from std_msgs.msg import Bool, Empty, String
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
from crazyflie_takeoff.flight import FlightStateMachine, Plan
from crazyflie_takeoff.flight_state import COMMANDED, UNKNOWN, FlightState
from crazyflie_takeoff.flight_topics import FlightTopicParameters
from crazyflie_takeoff.recovery import FLYING_HEIGHT, recover_state
from crazyflie_utils import Node, NodeHandle, ServiceError, parameter
from crazyflie_utils.parameter_types import DURATION, METRES, SERVICE, TOPIC, Number
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.vectors import from_vector

TIME_STEP = 0.01
"""Period of the server, s."""

STATE_LIMIT = 0.5
"""A measured state older than this is not used, s."""

RECOVERY_LIMIT = 1.0
"""How long a server that has started looks for the state of the flight, s."""

START_LIMIT = 5.0
"""How long after the server's start a takeoff waits for the first state and for a
controller, s: nodes that are launched together need a while to find each other."""


class TakeoffServerParameters(FlightTopicParameters):
    """Parameters of `TakeoffServerNode`."""

    control_topic: str = parameter(
        TOPIC, "thrust of takeoff and landing goes here", name="topics/control"
    )
    reference_topic: str = parameter(
        TOPIC, "hover point and descent go here", name="topics/reference"
    )
    state_topic: str | None = parameter(
        TOPIC, "where the vehicle is; without it nothing is known", None, "topics/state"
    )
    takeoff_service: str = parameter(SERVICE, "takes off", "/takeoff", "srv/takeoff")
    land_service: str = parameter(SERVICE, "lands", "/land", "srv/land")
    hover_x: float = parameter(METRES, "hover point after takeoff", name="hover/x", live=True)
    hover_y: float = parameter(METRES, "hover point after takeoff", name="hover/y", live=True)
    hover_z: float = parameter(METRES, "hover point after takeoff", name="hover/z", live=True)
    open_loop: float = parameter(
        DURATION, "how long thrust g + 0.2 lifts off", 1.0, "duration/open_loop"
    )
    settle: float = parameter(
        DURATION, "how long the controller has to reach the hover point", 5.0, "duration/hover"
    )
    descent_speed: float = parameter(
        Number("m/s", minimum=0.0),
        "how fast a landing sinks before the ramp; 0 for the bare ramp",
        0.3,
        "landing/descent_speed",
        live=True,
    )

    def plan(self) -> Plan:
        """Return how to take off and land."""
        hover = (self.hover_x, self.hover_y, self.hover_z)
        return Plan(hover, self.open_loop, self.settle, self.descent_speed)


class TakeoffServerNode(Node):
    """Let the vehicle take off and land when a service asks for it."""

    def __init__(self) -> None:
        # None until it is known where the flight stands.
        self._flight: FlightStateMachine | None = None
        self._is_starting = True
        self._filter_reported = False
        self._has_controller = True
        self._had_controller = False
        self._remembered: FlightState | None = None
        self._is_commanded = True
        self._position: tuple[float, float, float] | None = None
        self._position_time = 0.0
        self._published_state: FlightState | None = None
        self._pending: Future[EmptyResponse] | None = None
        self._waiting: list[tuple[str, Future[EmptyResponse]]] = []

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(TakeoffServerParameters, self._reconfigure)

    def _reconfigure(self, parameters):
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
        self._in_flight = handle.publisher(parameters.in_flight_topic, Empty)
        self._flight_state = handle.publisher(parameters.flight_state_topic, String, latch=True)
        handle.advertise_service(parameters.takeoff_service, EmptyService, self._on_takeoff)
        handle.advertise_service(parameters.land_service, EmptyService, self._on_land)
        handle.subscribe(parameters.filter_state_topic, String, self._on_filter_state)
        handle.subscribe(parameters.controller_topic, Bool, self._on_controller)
        if parameters.state_topic is not None:
            handle.subscribe(
                parameters.state_topic,
                PositionVelocityYawStateStamped,
                self._on_state,
                finite="state",
            )
        handle.timer(TIME_STEP, self._on_timer)
        # Whether connections come about has nothing to do with simulated time.
        self._recovery_timer = handle.timer(RECOVERY_LIMIT, self._recover_state, steady=True)
        self._start_timer = handle.timer(START_LIMIT, self._end_start, steady=True)

    def make_safe(self) -> None:
        """End a takeoff with a landing, let a landing go on, and tell the callers."""
        if self._flight is not None:
            self._flight.abort()
        calls = [future for _, future in self._waiting]
        if self._pending is not None:
            calls.append(self._pending)
        self._waiting = []
        self._pending = None
        for future in calls:
            future.set_exception(
                ServiceError(f"{self._handle.name} has failed or is shutting down; see its log")
            )

    # Services.

    def _on_takeoff(self, _):
        return self._serve(self._parameters.takeoff_service)

    def _on_land(self, _):
        return self._serve(self._parameters.land_service)

    def _serve(self, service):
        future: Future[EmptyResponse] = Future()
        self._waiting.append((service, future))
        self._serve_waiting()
        return future.result() if future.done() else future

    def _serve_waiting(self):
        if self._flight is None:
            return
        waiting, self._waiting = self._waiting, []
        for service, future in waiting:
            if service == self._parameters.takeoff_service and self._lacks_what_may_come():
                self._waiting.append((service, future))
            else:
                self._begin(self._flight, service, future)

    def _lacks_what_may_come(self):
        # What was there and is gone is no matter of waiting.
        lacks_state = self._parameters.state_topic is not None and self._position is None
        lacks_controller = not self._has_controller and not self._had_controller
        return self._is_starting and (lacks_state or lacks_controller)

    def _end_start(self):
        self._start_timer.stop()
        self._is_starting = False

    def _begin(self, flight, service, future):
        try:
            if service == self._parameters.takeoff_service:
                self._refuse_without_feedback()
                flight.takeoff()
            else:
                flight.land()
        except RefusalError as reason:
            name = self._handle.resolve(service)
            future.set_exception(ServiceError(f"{name} refused: {reason}"))
        else:
            self._pending = future

    def _refuse_without_feedback(self):
        topic = self._parameters.state_topic
        if topic is not None and self._known_position() is None:
            raise RefusalError(
                f"no state has come on {self._handle.resolve(topic)} for {STATE_LIMIT:g} s; are "
                "the estimator and the source of /tf running?"
            )
        if not self._has_controller:
            raise RefusalError("nobody publishes commanded controls; is the controller running?")

    # Where the flight stands.

    def _on_filter_state(self, message):
        try:
            knows_nothing = message.data in (UNKNOWN, COMMANDED)
            self._remembered = None if knows_nothing else FlightState(message.data)
        except ValueError:
            self._handle.warn(
                f"ignoring {message.data!r}, which is no flight state, on "
                f"{self._parameters.filter_state_topic}",
                throttle=1.0,
                key="flight state",
            )
        else:
            self._filter_reported = True
            self._is_commanded = message.data != UNKNOWN

    def _on_controller(self, message):
        self._has_controller = message.data
        self._had_controller = self._had_controller or message.data

    def _on_state(self, message):
        self._position = (message.state.x, message.state.y, message.state.z)
        self._position_time = self._handle.time()

    def _known_position(self):
        if self._position is None:
            return None
        now = self._handle.time()
        # After a reset of the clock the age counts from there.
        self._position_time = min(self._position_time, now)
        return self._position if now - self._position_time < STATE_LIMIT else None

    def _has_all_evidence(self):
        position = self._known_position()
        sees_enough = self._parameters.state_topic is None or position is not None
        if not (self._filter_reported and sees_enough):
            return False
        # A filter that has only just started may get controls yet.
        is_high = position is not None and position[2] > FLYING_HEIGHT
        return self._is_commanded or not is_high

    def _recover_state(self):
        self._recovery_timer.stop()
        if self._flight is not None:
            return
        plan = self._parameters.plan()
        position = self._known_position()
        height = None if position is None else position[2]
        can_descend = plan.descent_speed > 0.0
        recovered = recover_state(self._remembered, height, can_descend, self._is_commanded)
        self._handle.info(f"begins {recovered.state.value}: {recovered.reason}")
        self._flight = FlightStateMachine(plan, recovered.state, recovered.announced)
        self._serve_waiting()

    # The flight.

    def _on_timer(self):
        if self._flight is None and self._has_all_evidence():
            self._recover_state()
        if self._waiting:
            self._serve_waiting()
        if self._flight is not None:
            self._publish(self._flight.tick(self._handle.time(), self._known_position()))

    def _publish(self, output):
        if output.state is not self._published_state:
            self._published_state = output.state
            self._flight_state.publish(String(output.state.value))
        if output.toggle:
            self._in_flight.publish(Empty())
        if output.reference is not None:
            message = PositionVelocityStateStamped()
            message.header.stamp = self._handle.stamp()
            message.state = from_vector(PositionVelocityState, output.reference)
            self._reference.publish(message)
        if output.thrust is not None:
            message = ControlStamped(control=Control(thrust=output.thrust))
            message.header.stamp = self._handle.stamp()
            self._control.publish(message)
        if self._pending is not None and output.state.is_settled:
            future, self._pending = self._pending, None
            future.set_result(EmptyResponse())
