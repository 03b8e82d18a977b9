"""ROS interface of the conversion to cmd_vel."""

from geometry_msgs.msg import Twist, Vector3

from crazyflie_control_merger.cmd_vel import cmd_vel_from_control
from crazyflie_msgs.msg import ControlStamped
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import TOPIC
from crazyflie_utils.vectors import is_finite, to_vector


class CmdVelConverterNode(Node):
    """Publish each control in the form that the radio driver expects."""

    def __init__(self):
        super().__init__()
        self._control_topic = None
        self._cmd_vel_topic = None
        self._publisher = None

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        self._control_topic = handle.param("topics/control", TOPIC)
        self._cmd_vel_topic = handle.param("topics/cmd_vel", TOPIC)

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        self._publisher = handle.publisher(self._cmd_vel_topic, Twist)
        handle.subscribe(self._control_topic, ControlStamped, self._on_control)

    def _on_control(self, message):
        if not is_finite(message.control):
            self._handle.warn(
                f"ignoring a control on {self._control_topic} that is not finite", throttle=1.0
            )
            return
        linear, angular = cmd_vel_from_control(*map(float, to_vector(message.control)))
        self._publisher.publish(Twist(linear=Vector3(*linear), angular=Vector3(*angular)))
