"""Step 2: the service that answers with the velocity."""

from typing_extensions import override

from crazyflie_tutorial_msgs.srv import VelocityAt, VelocityAtResponse
from crazyflie_utils import Node, NodeHandle
from my_sweep.oscillator import velocity


class OscillatorNode(Node):
    """Answer calls of /my_oscillator."""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        """There are no parameters."""

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        """Step 2: advertise my_oscillator (VelocityAt); answer with a VelocityAtResponse."""
