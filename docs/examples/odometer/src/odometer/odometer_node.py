"""ROS interface of the odometer."""

from std_msgs.msg import Float64
from std_srvs.srv import Empty
from typing_extensions import override

from crazyflie_msgs.msg import PositionVelocityYawStateStamped
from crazyflie_utils import Node, NodeHandle, Parameters, parameter, topic
from crazyflie_utils.parameters.types import TIME_STEP, Number
from odometer.odometer import Odometer


class OdometerParameters(Parameters):
    """Parameters of `OdometerNode`."""

    time_step: float = parameter(TIME_STEP, "from one message to the next")
    state_topic: str = topic("state", "where states come from")
    distance_topic: str = topic("distance", "where distances go")
    max_step: float = parameter(
        Number("m", above=0.0),
        "two positions further apart are a jump, which is not counted",
        default=0.2,
        live=True,
    )


class OdometerNode(Node):
    """Publish the distance a vehicle has flown; the service ~reset begins again at 0."""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(OdometerParameters, self._reconfigure)
        self._odometer = Odometer(self._parameters.max_step)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._publisher = handle.publisher(parameters.distance_topic, Float64)
        handle.advertise_service("~reset", Empty, self._on_reset)
        handle.subscribe(
            parameters.state_topic, PositionVelocityYawStateStamped, self._on_state, finite="state"
        )
        handle.timer(parameters.time_step, self._on_timer)

    def _reconfigure(self, parameters):
        self._odometer.max_step = parameters.max_step

    def _on_reset(self, _):
        self._odometer.reset()

    def _on_state(self, message):
        self._odometer.add((message.state.x, message.state.y, message.state.z))

    def _on_timer(self):
        self._publisher.publish(Float64(self._odometer.distance))
