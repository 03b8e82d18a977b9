"""ROS interface of the choice between takeoff control and commanded control."""

from std_msgs.msg import Empty, String

from crazyflie_msgs.msg import ControlStamped
from crazyflie_takeoff.control_filter import ControlFilter
from crazyflie_takeoff.flight_state import COMMANDED, UNKNOWN, FlightState
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import TOPIC
from crazyflie_utils.vectors import is_finite

LISTENING_TIME = 0.4
"""How long a filter that has started listens before it passes a controller, s: some
periods of the zero thrust on the ground, and less than a vehicle flies on without
controls."""


class TakeoffControlFilterNode(Node):
    """Pass on takeoff control always, and commanded control in flight."""

    def __init__(self):
        super().__init__()
        self._topics = {}
        self._filter = ControlFilter()
        self._final = None
        self._filter_state = None
        self._published_state = None
        self._listening_timer = None

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        for name in ("takeoff_control", "commanded_control", "final_control", "in_flight"):
            self._topics[name] = handle.param(f"topics/{name}", TOPIC)
        in_flight = self._topics["in_flight"]
        for name, default in (
            ("flight_state", f"{in_flight}_state"),
            ("filter_state", f"{in_flight}_filter"),
        ):
            self._topics[name] = handle.param(f"topics/{name}", TOPIC, default)

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        topics = self._topics
        self._final = handle.publisher(topics["final_control"], ControlStamped)
        self._filter_state = handle.publisher(topics["filter_state"], String, latch=True)
        self._publish_state()
        handle.subscribe(topics["flight_state"], String, self._on_flight_state)
        handle.subscribe(topics["in_flight"], Empty, self._on_toggle)
        handle.subscribe(topics["takeoff_control"], ControlStamped, self._on_takeoff_control)
        handle.subscribe(topics["commanded_control"], ControlStamped, self._on_commanded_control)
        # Whether connections come about has nothing to do with simulated time.
        self._listening_timer = handle.timer(LISTENING_TIME, self._stop_listening, steady=True)

    def _on_flight_state(self, message):
        try:
            self._filter.hear_state(FlightState(message.data))
        except ValueError:
            self._handle.warn(
                f"ignoring {message.data!r} on {self._topics['flight_state']}, which is no "
                "flight state",
                throttle=1.0,
            )
        self._publish_state()

    def _on_toggle(self, _):
        self._filter.toggle()
        self._publish_state()

    def _on_takeoff_control(self, message):
        if self._is_good(message, "takeoff_control"):
            now = self._handle.time()
            self._final.publish(self._filter.takeoff(now, message, message.control.thrust))

    def _on_commanded_control(self, message):
        if self._is_good(message, "commanded_control"):
            self._pass_on(self._filter.commanded(self._handle.time(), message))
            self._publish_state()

    def _stop_listening(self):
        self._listening_timer.stop()
        self._pass_on(self._filter.stop_listening(self._handle.time()))

    def _pass_on(self, message):
        if message is not None:
            self._final.publish(message)

    def _is_good(self, message, topic):
        if is_finite(message.control):
            return True
        self._handle.warn(
            f"ignoring a control on {self._topics[topic]} that is not finite", throttle=1.0
        )
        return False

    def _publish_state(self):
        remembered = self._filter.remembered
        if remembered is not None:
            state = remembered.value
        else:
            state = COMMANDED if self._filter.is_commanded else UNKNOWN
        if state != self._published_state:
            self._published_state = state
            self._filter_state.publish(String(state))
