"""ROS interface of the conversion to cmd_vel."""

from geometry_msgs.msg import Twist, Vector3
from typing_extensions import override

from crazyflie_control_merger.cmd_vel import cmd_vel_from_control
from crazyflie_msgs.msg import ControlStamped
from crazyflie_utils import Node, NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import TOPIC
from crazyflie_utils.vectors import to_vector


class CmdVelConverterParameters(Parameters):
    """Parameters of `CmdVelConverterNode`."""

    control_topic: str = parameter(TOPIC, "where controls come from", name="topics/control")
    cmd_vel_topic: str = parameter(
        TOPIC, "where commands of the radio driver go", name="topics/cmd_vel"
    )


class CmdVelConverterNode(Node):
    """Publish each control in the form that the radio driver expects."""

    needed_in_flight = True

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(CmdVelConverterParameters)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        handle.claim_controls(self._parameters.control_topic, "real")
        self._publisher = handle.publisher(self._parameters.cmd_vel_topic, Twist)
        handle.subscribe(
            self._parameters.control_topic, ControlStamped, self._on_control, finite="control"
        )

    def _on_control(self, message):
        linear, angular = cmd_vel_from_control(*map(float, to_vector(message.control)))
        self._publisher.publish(Twist(linear=Vector3(*linear), angular=Vector3(*angular)))
