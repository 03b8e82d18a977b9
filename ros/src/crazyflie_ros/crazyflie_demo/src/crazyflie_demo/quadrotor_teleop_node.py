"""Flight by hand with the parameters of hector_quadrotor's node quadrotor_teleop."""

from typing_extensions import override

from crazyflie_demo.cmd_vel_teleop_node import CmdVelTeleopNode, Sticks, TeleopParameters
from crazyflie_model.limits import FULL_PWM
from crazyflie_utils import parameter
from crazyflie_utils.parameters.types import Integer, Number

_AXIS = Integer(-256, 256)
_TILT = Number("deg", minimum=-60.0, maximum=60.0)


class QuadrotorTeleopParameters(TeleopParameters):
    """Parameters of `QuadrotorTeleopNode`: axes are numbered from 1, negative if inverted."""

    x_axis: int = parameter(_AXIS, "axis of cmd_vel's linear.x; 0 for none", 4)
    y_axis: int = parameter(_AXIS, "axis of linear.y", 3)
    z_axis: int = parameter(_AXIS, "axis of linear.z, the thrust", 2)
    yaw_axis: int = parameter(_AXIS, "axis of angular.z", 1)
    x_velocity_max: float = parameter(_TILT, "linear.x at full deflection", 2.0, live=True)
    y_velocity_max: float = parameter(_TILT, "linear.y at full deflection", 2.0, live=True)
    z_velocity_max: float = parameter(
        Number("PWM", minimum=-FULL_PWM, maximum=FULL_PWM),
        "linear.z at full deflection",
        2.0,
        live=True,
    )
    yaw_velocity_max: float = parameter(
        Number("deg/s"), "angular.z at full deflection", 1.5707963267948966, live=True
    )

    @override
    def sticks(self) -> Sticks:
        """Return the sticks; inversion and no axis are in the factor."""
        return tuple(
            (abs(axis) - 1, scale * (axis > 0) - scale * (axis < 0))
            for axis, scale in (
                (self.x_axis, self.x_velocity_max),
                (self.y_axis, self.y_velocity_max),
                (self.yaw_axis, self.yaw_velocity_max),
                (self.z_axis, self.z_velocity_max),
            )
        )


class QuadrotorTeleopNode(CmdVelTeleopNode):
    """The same as `CmdVelTeleopNode`, by other parameters."""

    parameters_class = QuadrotorTeleopParameters
