"""ROS interface of a test of the motors: a thrust that does not change."""

from geometry_msgs.msg import Twist, Vector3
from typing_extensions import override

from crazyflie_demo.parameters import SetpointParameters
from crazyflie_model.limits import MAX_SETPOINT_PWM
from crazyflie_utils import Node, NodeHandle, parameter
from crazyflie_utils.parameters.types import Number


class ConstThrustParameters(SetpointParameters):
    """Parameters of `ConstThrustNode`."""

    thrust: float = parameter(
        Number("PWM", minimum=0.0, maximum=MAX_SETPOINT_PWM),
        "thrust; about 42000 hovers",
        12000.0,
        live=True,
    )


class ConstThrustNode(Node):
    """Publish level setpoints with a constant thrust; zero thrust at the end."""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(ConstThrustParameters, self._reconfigure)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = handle.publisher("cmd_vel", Twist)
        handle.timer(1.0 / self._parameters.rate, self._on_timer)

    @override
    def enter_safe_state(self) -> None:
        self._publisher.publish(Twist())

    def _reconfigure(self, parameters):
        self._parameters = parameters

    def _on_timer(self):
        self._publisher.publish(Twist(linear=Vector3(0.0, 0.0, self._parameters.thrust)))
