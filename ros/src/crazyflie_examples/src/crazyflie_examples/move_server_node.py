"""ROS interface of a tour: a service that sends the vehicle to its next point."""

from std_srvs.srv import Empty, EmptyResponse

from crazyflie_examples.tour import DEFAULT_POINTS, Points, Tour
from crazyflie_msgs.msg import PositionVelocityState, PositionVelocityStateStamped
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import SERVICE, TOPIC


class MoveServerNode(Node):
    """Publish the next of a list of points as reference whenever the service is called."""

    def __init__(self):
        super().__init__()
        self._reference_topic = None
        self._service = None
        self._tour = None
        self._publisher = None

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        self._reference_topic = handle.param("topics/ref", TOPIC)
        self._service = handle.param("srv/move", SERVICE, "/move")
        self._tour = Tour(handle.param("points", Points(), DEFAULT_POINTS))

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        self._publisher = handle.publisher(
            self._reference_topic, PositionVelocityStateStamped, latch=True
        )
        handle.advertise_service(self._service, Empty, self._on_move)

    def _on_move(self, request):
        x, y, z = self._tour.move_on()
        reference = PositionVelocityStateStamped(state=PositionVelocityState(x=x, y=y, z=z))
        reference.header.stamp = self._handle.stamp()
        self._publisher.publish(reference)
        self._handle.info(f"on to ({x:g}, {y:g}, {z:g}) m")
        return EmptyResponse()
