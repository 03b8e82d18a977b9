"""Controls in the form that the radio driver expects on cmd_vel, and its ROS interface."""

import math

from geometry_msgs.msg import Twist, Vector3
from typing_extensions import override

from crazyflie_model.units import pwm_from_thrust
from crazyflie_msgs.msg import ControlStamped
from crazyflie_utils import Node, NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import TOPIC
from crazyflie_utils.vectors import to_vector

Vector = tuple[float, float, float]


def cmd_vel_from_control(
    roll: float, pitch: float, yaw_dot: float, thrust: float
) -> tuple[Vector, Vector]:
    """Return the two vectors of the twist that carries a control.

    From rad, rad/s (counter-clockwise) and m/s^2 to linear (pitch in degrees, roll in degrees,
    thrust in PWM, which the driver limits) and angular (0, 0, yaw rate in deg/s, clockwise).
    """
    return (
        (math.degrees(pitch), math.degrees(roll), float(pwm_from_thrust(thrust))),
        (0.0, 0.0, -math.degrees(yaw_dot)),
    )


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
