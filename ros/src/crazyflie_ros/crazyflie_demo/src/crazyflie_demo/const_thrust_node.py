"""ROS interface of a test of the motors: a thrust that does not change."""

from geometry_msgs.msg import Twist, Vector3

from crazyflie_model.limits import MAX_SETPOINT_PWM
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import Number


class ConstThrustNode(Node):
    """Publish level setpoints with a constant thrust; zero thrust at the end."""

    def __init__(self):
        super().__init__()
        self._thrust = None
        self._period = None
        self._publisher = None

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        self._thrust = handle.param(
            "thrust", Number("PWM", minimum=0.0, maximum=MAX_SETPOINT_PWM), 12000.0
        )
        self._period = 1.0 / handle.param("rate", Number("Hz", above=0.0, maximum=500.0), 50.0)

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        self._publisher = handle.publisher("cmd_vel", Twist)
        handle.timer(self._period, self._on_timer)

    def make_safe(self) -> None:
        """See `Node.make_safe`."""
        self._publisher.publish(Twist())

    def _on_timer(self):
        self._publisher.publish(Twist(linear=Vector3(0.0, 0.0, self._thrust)))
