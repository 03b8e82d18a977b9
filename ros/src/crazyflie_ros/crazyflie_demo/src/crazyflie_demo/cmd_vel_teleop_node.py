"""ROS interface of flight by hand: a joystick's axes to cmd_vel."""

from typing import ClassVar

from geometry_msgs.msg import Twist, Vector3
from typing_extensions import override

from crazyflie_demo.gamepad import PITCH, ROLL, THRUST, YAW
from crazyflie_demo.joy_axes import JoyAxes
from crazyflie_demo.parameters import AXIS, JoyParameters, SetpointParameters
from crazyflie_model.limits import FULL_PWM, MAX_SETPOINT_PWM
from crazyflie_utils import Node, NodeHandle, parameter
from crazyflie_utils.parameters.types import Number

#: Four joystick axes, numbered from 0, and what they are multiplied by.
Sticks = tuple[tuple[int, float], ...]

_TILT = Number("deg", above=0.0, maximum=60.0)


class TeleopParameters(JoyParameters, SetpointParameters):
    """Of nodes that turn a joystick's axes into cmd_vel."""

    def sticks(self) -> Sticks:
        """Return what moves linear.x, linear.y, angular.z and linear.z of cmd_vel."""
        raise NotImplementedError


class CmdVelTeleopParameters(TeleopParameters):
    """Parameters of `CmdVelTeleopNode`."""

    pitch_axis: int = parameter(AXIS, "number of the axis that pitches", PITCH, "axes/pitch")
    roll_axis: int = parameter(AXIS, "number of the axis that rolls", ROLL, "axes/roll")
    yaw_rate_axis: int = parameter(AXIS, "number of the axis that turns", YAW, "axes/yaw_rate")
    thrust_axis: int = parameter(AXIS, "number of the axis that lifts", THRUST, "axes/thrust")
    max_pitch: float = parameter(_TILT, "at full deflection", 30.0, "max/pitch", live=True)
    max_roll: float = parameter(_TILT, "at full deflection", 30.0, "max/roll", live=True)
    max_yaw_rate: float = parameter(
        Number("deg/s", above=0.0), "at full deflection", 200.0, "max/yaw_rate", live=True
    )
    max_thrust: float = parameter(
        Number("PWM", above=0.0, maximum=FULL_PWM),
        "at full deflection",
        MAX_SETPOINT_PWM,
        "max/thrust",
        live=True,
    )

    @override
    def sticks(self) -> Sticks:
        """Return the sticks; axes are positive to the left, roll and yaw rate to the right."""
        return (
            (self.pitch_axis, self.max_pitch),
            (self.roll_axis, -self.max_roll),
            (self.yaw_rate_axis, -self.max_yaw_rate),
            (self.thrust_axis, self.max_thrust),
        )


class CmdVelTeleopNode(Node):
    """Tilt, turn and lift a vehicle as the sticks are tilted.

    Thrust counts only after its stick has been at zero once. Without a joystick the
    node is silent, and the vehicle's watchdog does the rest.
    """

    parameters_class: ClassVar[type[TeleopParameters]] = CmdVelTeleopParameters

    def __init__(self) -> None:
        self._is_locked = True

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(self.parameters_class, self._reconfigure)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = handle.publisher("cmd_vel", Twist)
        self._axes = JoyAxes(handle, self._parameters.joy_topic)
        handle.timer(1.0 / self._parameters.rate, self._on_timer)

    def _reconfigure(self, parameters):
        self._parameters = parameters

    def _on_timer(self):
        parameters = self._parameters
        if not self._axes.are_alive():
            if not self._is_locked:
                self._handle.warn(f"no joystick on {parameters.joy_topic}: sending no setpoints")
            self._is_locked = True
            return
        x, y, yaw_rate, thrust = (
            self._axes.axis(axis) * scale for axis, scale in parameters.sticks()
        )
        if thrust <= 0.0:
            self._is_locked = False
        if self._is_locked:
            thrust = 0.0
        self._publisher.publish(Twist(Vector3(x, y, max(thrust, 0.0)), Vector3(0.0, 0.0, yaw_rate)))
