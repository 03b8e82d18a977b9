"""ROS interface of the choice between takeoff control and commanded control."""

from std_msgs.msg import Bool, Empty, String
from typing_extensions import override

from crazyflie_msgs.msg import ControlStamped
from crazyflie_takeoff.control_filter import ControlFilter
from crazyflie_takeoff.flight_state import COMMANDED, UNKNOWN, FlightState
from crazyflie_takeoff.flight_topics import FlightTopicParameters
from crazyflie_utils import Node, NodeHandle, parameter
from crazyflie_utils.parameter_types import TOPIC

LISTENING_TIME = 0.4
"""How long a filter that has started listens before it passes a controller, s: some
periods of the zero thrust on the ground, and less than a vehicle flies on without
controls."""

CONTROLLER_POLL_PERIOD = 0.1
"""How often it is looked whether there is a controller, s."""


class TakeoffControlFilterParameters(FlightTopicParameters):
    """Parameters of `TakeoffControlFilterNode`."""

    takeoff_control_topic: str = parameter(
        TOPIC, "the takeoff server's control", name="topics/takeoff_control"
    )
    commanded_control_topic: str = parameter(
        TOPIC, "the controller's control", name="topics/commanded_control"
    )
    final_control_topic: str = parameter(
        TOPIC, "the one that is passed on", name="topics/final_control"
    )


class TakeoffControlFilterNode(Node):
    """Pass on takeoff control always, and commanded control in flight."""

    def __init__(self) -> None:
        self._filter: ControlFilter[ControlStamped] = ControlFilter()
        self._published_state: str | None = None
        self._published_controller: bool | None = None

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(TakeoffControlFilterParameters)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._final = handle.publisher(parameters.final_control_topic, ControlStamped)
        self._filter_state = handle.publisher(parameters.filter_state_topic, String, latch=True)
        self._controller = handle.publisher(parameters.controller_topic, Bool, latch=True)
        self._publish_state()
        handle.subscribe(parameters.flight_state_topic, String, self._on_flight_state)
        handle.subscribe(parameters.in_flight_topic, Empty, self._on_toggle)
        handle.subscribe(
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
        # Whether connections come about has nothing to do with simulated time.
        self._listening_timer = handle.timer(LISTENING_TIME, self._stop_listening, steady=True)
        handle.timer(CONTROLLER_POLL_PERIOD, self._publish_controller, steady=True)

    def _on_flight_state(self, message):
        try:
            self._filter.set_state(FlightState(message.data))
        except ValueError:
            self._handle.warn(
                f"ignoring {message.data!r}, which is no flight state, on "
                f"{self._parameters.flight_state_topic}",
                throttle=1.0,
                key="flight state",
            )
        self._publish_state()

    def _on_toggle(self, _):
        self._filter.toggle()
        self._publish_state()

    def _on_takeoff_control(self, message):
        now = self._handle.time()
        self._final.publish(self._filter.takeoff(now, message, message.control.thrust))

    def _on_commanded_control(self, message):
        self._pass_on(self._filter.commanded(self._handle.time(), message))
        self._publish_state()

    def _stop_listening(self):
        self._listening_timer.stop()
        self._pass_on(self._filter.stop_listening(self._handle.time()))

    def _pass_on(self, message):
        if message is not None:
            self._final.publish(message)

    def _publish_controller(self):
        has_controller = self._commands.has_publishers()
        if has_controller != self._published_controller:
            self._published_controller = has_controller
            self._controller.publish(Bool(has_controller))

    def _publish_state(self):
        remembered = self._filter.remembered
        if remembered is not None:
            state = remembered.value
        else:
            state = COMMANDED if self._filter.is_commanded else UNKNOWN
        if state != self._published_state:
            self._published_state = state
            self._filter_state.publish(String(state))
