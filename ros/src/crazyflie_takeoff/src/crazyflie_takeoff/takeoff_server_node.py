"""ROS interface of takeoff and landing."""

from concurrent.futures import Future

from std_msgs.msg import Empty, String
from std_srvs.srv import Empty as EmptyService
from std_srvs.srv import EmptyResponse

from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_takeoff.flight import Flight, Plan
from crazyflie_takeoff.flight_state import COMMANDED, UNKNOWN, FlightState
from crazyflie_takeoff.recovery import FLYING_HEIGHT, find_state
from crazyflie_utils.node import Node
from crazyflie_utils.parameters import DURATION, METRES, SERVICE, TOPIC, Number
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.transport import ServiceError
from crazyflie_utils.vectors import from_vector, is_finite

TIME_STEP = 0.01
"""Period of the server, s."""

STATE_LIMIT = 0.5
"""A measured state older than this is not used, s."""

FINDING_LIMIT = 1.0
"""How long a server that has started looks for the state of the flight, s."""


class TakeoffServerNode(Node):
    """Let the vehicle take off and land when a service asks for it."""

    def __init__(self):
        super().__init__()
        self._plan = None
        self._topics = {}
        self._services = {}
        self._control = None
        self._reference = None
        self._in_flight = None
        self._flight_state = None
        self._finding_timer = None
        # None until it is known where the flight stands.
        self._flight = None
        self._heard_filter = False
        self._remembered = None
        self._is_commanded = True
        self._position = None
        self._position_time = None
        self._published_state = None
        self._pending = None
        self._waiting = []

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        for name in ("reference", "control", "in_flight"):
            self._topics[name] = handle.param(f"topics/{name}", TOPIC)
        in_flight = self._topics["in_flight"]
        defaults = {
            "state": None,
            "flight_state": f"{in_flight}_state",
            "filter_state": f"{in_flight}_filter",
        }
        for name, default in defaults.items():
            self._topics[name] = handle.param(f"topics/{name}", TOPIC, default)
        for name in ("takeoff", "land"):
            self._services[name] = handle.param(f"srv/{name}", SERVICE, f"/{name}")
        speed = Number(unit="m/s", minimum=0.0)
        self._plan = Plan(
            hover=tuple(handle.param(f"hover/{axis}", METRES) for axis in "xyz"),
            open_loop=handle.param("duration/open_loop", DURATION, 1.0),
            settle=handle.param("duration/hover", DURATION, 5.0),
            descent_speed=handle.param("landing/descent_speed", speed, 0.3),
        )

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        topics = self._topics
        self._control = handle.publisher(topics["control"], ControlStamped)
        self._reference = handle.publisher(
            topics["reference"], PositionVelocityStateStamped, latch=True
        )
        self._in_flight = handle.publisher(topics["in_flight"], Empty)
        self._flight_state = handle.publisher(topics["flight_state"], String, latch=True)
        handle.advertise_service(self._services["takeoff"], EmptyService, self._on_takeoff)
        handle.advertise_service(self._services["land"], EmptyService, self._on_land)
        handle.subscribe(topics["filter_state"], String, self._on_filter_state)
        if topics["state"]:
            handle.subscribe(topics["state"], PositionVelocityYawStateStamped, self._on_state)
        handle.timer(TIME_STEP, self._on_timer)
        # Whether connections come about has nothing to do with simulated time.
        self._finding_timer = handle.timer(FINDING_LIMIT, self._find_state, steady=True)

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
        return self._serve("takeoff")

    def _on_land(self, _):
        return self._serve("land")

    def _serve(self, manoeuvre):
        future = Future()
        if self._flight is None:
            self._waiting.append((manoeuvre, future))
        else:
            self._begin(manoeuvre, future)
        return future.result() if future.done() else future

    def _begin(self, manoeuvre, future):
        try:
            if manoeuvre == "takeoff":
                self._flight.takeoff()
            else:
                self._flight.land()
        except RefusalError as reason:
            service = self._handle.resolve(self._services[manoeuvre])
            future.set_exception(ServiceError(f"{service} refused: {reason}"))
        else:
            self._pending = future

    # Where the flight stands.

    def _on_filter_state(self, message):
        try:
            knows_nothing = message.data in (UNKNOWN, COMMANDED)
            self._remembered = None if knows_nothing else FlightState(message.data)
        except ValueError:
            self._handle.warn(
                f"ignoring {message.data!r} on {self._topics['filter_state']}, which is no "
                "flight state",
                throttle=1.0,
            )
        else:
            self._heard_filter = True
            self._is_commanded = message.data != UNKNOWN

    def _on_state(self, message):
        if not is_finite(message.state):
            self._handle.warn(
                f"ignoring a state on {self._topics['state']} that is not finite", throttle=1.0
            )
            return
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
        sees_enough = self._topics["state"] is None or position is not None
        if not (self._heard_filter and sees_enough):
            return False
        # A filter that has only just started may hear a controller yet.
        is_high = position is not None and position[2] > FLYING_HEIGHT
        return self._is_commanded or not is_high

    def _find_state(self):
        self._finding_timer.stop()
        if self._flight is not None:
            return
        position = self._known_position()
        height = None if position is None else position[2]
        can_descend = self._plan.descent_speed > 0.0
        finding = find_state(self._remembered, height, can_descend, self._is_commanded)
        self._handle.info(f"begins {finding.state.value}: {finding.reason}")
        self._flight = Flight(self._plan, finding.state, finding.announced)
        waiting, self._waiting = self._waiting, []
        for manoeuvre, future in waiting:
            self._begin(manoeuvre, future)

    # The flight.

    def _on_timer(self):
        if self._flight is None and self._has_all_evidence():
            self._find_state()
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
