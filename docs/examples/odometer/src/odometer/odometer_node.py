"""ROS interface of the odometer."""

from std_msgs.msg import Float64
from std_srvs.srv import Empty, EmptyResponse

from crazyflie_msgs.msg import PositionVelocityYawStateStamped
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import TIME_STEP, TOPIC, Number
from crazyflie_utils.vectors import is_finite
from odometer.odometer import Odometer


class OdometerNode(Node):
    """Publish the distance a vehicle has flown; the service ~reset begins again at 0."""

    def __init__(self):
        super().__init__()
        self._time_step = None
        self._state_topic = None
        self._distance_topic = None
        self._odometer = None
        self._publisher = None

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        self._time_step = handle.param("time_step", TIME_STEP)
        self._state_topic = handle.param("topics/state", TOPIC)
        self._distance_topic = handle.param("topics/distance", TOPIC)
        self._odometer = Odometer(handle.param("max_step", Number(unit="m", above=0.0), 0.2))

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        self._publisher = handle.publisher(self._distance_topic, Float64)
        handle.advertise_service("~reset", Empty, self._on_reset)
        handle.subscribe(self._state_topic, PositionVelocityYawStateStamped, self._on_state)
        handle.timer(self._time_step, self._on_timer)

    def _on_reset(self, _):
        self._odometer.reset()
        return EmptyResponse()

    def _on_state(self, message):
        if is_finite(message.state):
            self._odometer.add((message.state.x, message.state.y, message.state.z))
        else:
            self._handle.warn(
                f"ignoring a state on {self._state_topic} that is not finite", throttle=1.0
            )

    def _on_timer(self):
        self._publisher.publish(Float64(self._odometer.distance))
