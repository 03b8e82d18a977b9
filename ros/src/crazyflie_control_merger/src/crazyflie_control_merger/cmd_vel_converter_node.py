"""Controls in the form that the radio driver expects on cmd_vel, and its ROS interface."""

import math

from geometry_msgs.msg import Twist, Vector3
from typing_extensions import override

from crazyflie_model.angles import Triple
from crazyflie_model.quadrotor import CRAZYFLIE, QuadrotorParameters
from crazyflie_msgs.msg import ControlStamped
from crazyflie_utils import Node, NodeHandle, Parameters, parameter, topic
from crazyflie_utils.parameters import vehicle_model
from crazyflie_utils.parameters.vehicle_model import VEHICLE_MODEL
from crazyflie_utils.vectors import to_tuple


def cmd_vel_from_control(
    roll: float,
    pitch: float,
    yaw_dot: float,
    thrust: float,
    model: QuadrotorParameters = CRAZYFLIE,
) -> tuple[Triple, Triple]:
    """Return the two vectors of the twist that carries a control for a vehicle.

    From rad, rad/s (counter-clockwise) and m/s^2 to linear (pitch in degrees, roll in degrees,
    thrust in PWM, which the driver limits) and angular (0, 0, yaw rate in deg/s, clockwise). A
    thrust of 9.81 carries the vehicle of the model, whose trims are added.
    """
    roll, pitch = roll + model.roll_trim, pitch + model.pitch_trim
    return (
        (math.degrees(pitch), math.degrees(roll), float(model.pwm(thrust))),
        (0.0, 0.0, -math.degrees(yaw_dot)),
    )


class CmdVelConverterParameters(Parameters):
    """Parameters of `CmdVelConverterNode`."""

    control_topic: str = topic("control", "where controls come from")
    cmd_vel_topic: str = topic("cmd_vel", "where commands of the radio driver go")
    model: str = parameter(
        VEHICLE_MODEL,
        "type of the vehicle, or model file: its thrust curve, mass and trims",
        "cf21",
    )


class CmdVelConverterNode(Node[CmdVelConverterParameters]):
    """Publish each control in the form that the radio driver expects."""

    needed_in_flight = True

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._model = vehicle_model.load(self._parameters.model)
        handle.claim_controls(self._parameters.control_topic, "real")
        self._publisher = handle.publisher(self._parameters.cmd_vel_topic, Twist)
        handle.subscribe(
            self._parameters.control_topic, ControlStamped, self._on_control, finite="control"
        )

    def _on_control(self, message):
        roll, pitch, yaw_dot, thrust = to_tuple(message.control)
        linear, angular = cmd_vel_from_control(roll, pitch, yaw_dot, thrust, self._model)
        self._publisher.publish(Twist(linear=Vector3(*linear), angular=Vector3(*angular)))
