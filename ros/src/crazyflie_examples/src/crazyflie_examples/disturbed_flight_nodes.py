"""Nodes of launch files for safety filters: waypoints in turn, and a disturbance of the vehicle."""

import itertools

from typing_extensions import override

from crazyflie_examples.move_server_node import DEFAULT_POINTS, POINTS, Point
from crazyflie_msgs.msg import (
    Disturbance,
    DisturbanceStamped,
    PositionVelocityState,
    PositionVelocityStateStamped,
)
from crazyflie_utils import Node, NodeHandle, Parameters, parameter, topic
from crazyflie_utils.parameters.types import FINITE, ListOf, Number
from crazyflie_utils.vectors import from_vector, stamped

_PERIOD = Number("s", minimum=0.01)


class WaypointParameters(Parameters):
    """Parameters of `WaypointNode`."""

    reference_topic: str = topic("ref", "where references go", "/ref")
    points: tuple[Point, ...] = parameter(
        POINTS, "the waypoints; after the last one they start again", DEFAULT_POINTS
    )
    period: float = parameter(_PERIOD, "time from one to the next", 5.0)


class WaypointNode(Node[WaypointParameters]):
    """Publish waypoints as references, one after the other."""

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._publisher = handle.publisher(
            parameters.reference_topic, PositionVelocityStateStamped, latch=True
        )
        self._points = itertools.cycle(parameters.points)
        handle.timer(parameters.period, self._publish_next)

    def _publish_next(self):
        x, y, z = next(self._points)
        state, stamp = PositionVelocityState(x=x, y=y, z=z), self._handle.stamp()
        self._publisher.publish(stamped(PositionVelocityStateStamped, stamp, state=state))


class DisturbanceParameters(Parameters):
    """Parameters of `DisturbanceNode`."""

    disturbance_topic: str = topic("disturbance", "where disturbances go", "/disturbance")
    disturbance: tuple[float, ...] = parameter(
        ListOf(FINITE, 7),
        "added to the derivatives of x, y, z (m/s), their velocities (m/s^2) and yaw (rad/s)",
        (0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0),
    )
    period: float = parameter(_PERIOD, "time from one message to the next", 0.1)


class DisturbanceNode(Node[DisturbanceParameters]):
    """Publish a disturbance of a simulated vehicle."""

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._publisher = handle.publisher(parameters.disturbance_topic, DisturbanceStamped)
        handle.timer(parameters.period, self._publish)

    def _publish(self):
        disturbance = from_vector(Disturbance, self._parameters.disturbance)
        stamp = self._handle.stamp()
        message = stamped(DisturbanceStamped, stamp, disturbance=disturbance)
        self._publisher.publish(message)
