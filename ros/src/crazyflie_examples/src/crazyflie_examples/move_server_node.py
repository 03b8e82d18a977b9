"""ROS interface of a route: a service that sends the vehicle to its next point."""

import itertools

from std_srvs.srv import Empty
from typing_extensions import override

from crazyflie_msgs.msg import PositionVelocityState, PositionVelocityStateStamped
from crazyflie_utils import Node, NodeHandle, Parameters, parameter, topic
from crazyflie_utils.parameters.types import METRES, SERVICE, Converted
from crazyflie_utils.text import shown
from crazyflie_utils.vectors import stamped

Point = tuple[float, float, float]  #: x, y, z in m.

#: Around the default hover point and back to it, m.
DEFAULT_POINTS: tuple[Point, ...] = (
    (0.5, 0.5, 1.0),
    (-0.5, 0.5, 1.0),
    (-0.5, -0.5, 1.5),
    (0.5, -0.5, 1.0),
    (0.0, 0.0, 1.0),
)


def _points(value):
    if not isinstance(value, list) or not value:
        raise ValueError
    return tuple(_point(number, item) for number, item in enumerate(value, start=1))


def _point(number, item):
    try:
        x, y, z = item
        return METRES(x), METRES(y), METRES(z)
    except (TypeError, ValueError):
        raise ValueError(f"point {number} is {shown(item)}") from None


POINTS = Converted(
    _points,
    "a list of points [x, y, z], finite numbers in m",
    "list of [x, y, z]",
    "m",
    "at least one",
)


class MoveServerParameters(Parameters):
    """Parameters of `MoveServerNode`."""

    reference_topic: str = topic("ref", "where references go")
    service: str = parameter(SERVICE, "moves the vehicle to the next point", "/move", "srv/move")
    points: tuple[Point, ...] = parameter(
        POINTS, "the route; after its last point it starts again", DEFAULT_POINTS
    )


class MoveServerNode(Node[MoveServerParameters]):
    """Publish the next point of a route as reference whenever the service is called."""

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = handle.publisher(
            self._parameters.reference_topic, PositionVelocityStateStamped, latch=True
        )
        self._route = itertools.cycle(self._parameters.points)
        handle.advertise_service(self._parameters.service, Empty, self._on_move)

    def _on_move(self, _):
        x, y, z = next(self._route)
        state, stamp = PositionVelocityState(x=x, y=y, z=z), self._handle.stamp()
        self._publisher.publish(stamped(PositionVelocityStateStamped, stamp, state=state))
        self._handle.info(f"on to ({x:g}, {y:g}, {z:g}) m")
