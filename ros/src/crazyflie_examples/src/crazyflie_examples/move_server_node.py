"""ROS interface of a route: a service that sends the vehicle to its next point."""

from std_srvs.srv import Empty, EmptyResponse
from typing_extensions import override

from crazyflie_examples.route import DEFAULT_POINTS, Point, Points, Route
from crazyflie_msgs.msg import PositionVelocityState, PositionVelocityStateStamped
from crazyflie_utils import Node, NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import SERVICE, TOPIC


class MoveServerParameters(Parameters):
    """Parameters of `MoveServerNode`."""

    reference_topic: str = parameter(TOPIC, "where references go", name="topics/ref")
    service: str = parameter(SERVICE, "moves the vehicle to the next point", "/move", "srv/move")
    points: tuple[Point, ...] = parameter(
        Points(), "the route; after its last point comes the first", DEFAULT_POINTS
    )


class MoveServerNode(Node):
    """Publish the next point of a route as reference whenever the service is called."""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(MoveServerParameters)
        self._route = Route(self._parameters.points)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = handle.publisher(
            self._parameters.reference_topic, PositionVelocityStateStamped, latch=True
        )
        handle.advertise_service(self._parameters.service, Empty, self._on_move)

    def _on_move(self, _):
        x, y, z = self._route.next_point()
        reference = PositionVelocityStateStamped(state=PositionVelocityState(x=x, y=y, z=z))
        reference.header.stamp = self._handle.stamp()
        self._publisher.publish(reference)
        self._handle.info(f"on to ({x:g}, {y:g}, {z:g}) m")
        return EmptyResponse()
