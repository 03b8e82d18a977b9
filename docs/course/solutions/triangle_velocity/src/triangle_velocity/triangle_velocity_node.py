"""The node: one service."""

from typing_extensions import override

from crazyflie_tutorial_msgs.srv import VelocityAt, VelocityAtResponse
from crazyflie_utils import Node, NodeHandle
from triangle_velocity.triangle_velocity import triangle_velocity


class TriangleVelocityNode(Node):
    """Answer calls for the velocity at a position."""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        """There are none."""

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        handle.advertise_service("triangle", VelocityAt, self._on_call)

    def _on_call(self, request):
        return VelocityAtResponse(triangle_velocity(request.x))
