"""ROS interfaces of flight by hand: sticks to cmd_vel, buttons to services."""

from geometry_msgs.msg import Twist, Vector3
from sensor_msgs.msg import Joy
from std_srvs.srv import Empty, EmptyRequest
from typing_extensions import override

from crazyflie_demo.joystick import EMERGENCY, HEADLIGHT, LAND, PITCH, ROLL, TAKEOFF, THRUST, YAW
from crazyflie_demo.node_parts import AXIS, JoyAxes, JoyParameters, SetpointParameters
from crazyflie_driver.srv import UpdateParams, UpdateParamsRequest
from crazyflie_model.limits import FULL_PWM, MAX_SETPOINT_PWM
from crazyflie_utils import Node, NodeHandle, parameter
from crazyflie_utils.parameters.server import ParameterWriter
from crazyflie_utils.parameters.types import BOOLEAN, Integer, Number

#: Four joystick axes, numbered from 0, and their factors.
Sticks = tuple[tuple[int, float], ...]

_TILT = Number("deg", above=0.0, maximum=60.0)


class TeleopParameters(JoyParameters, SetpointParameters):
    """Parameters of nodes that convert a joystick's axes to cmd_vel."""

    def sticks(self) -> Sticks:
        """Return the axes of linear.x, linear.y, angular.z and linear.z of cmd_vel."""
        raise NotImplementedError


class CmdVelTeleopParameters(TeleopParameters):
    """Parameters of `CmdVelTeleopNode`."""

    pitch_axis: int = parameter(AXIS, "number of the axis for pitch", PITCH, "axes/pitch")
    roll_axis: int = parameter(AXIS, "number of the axis for roll", ROLL, "axes/roll")
    yaw_rate_axis: int = parameter(
        AXIS, "number of the axis for the yaw rate", YAW, "axes/yaw_rate"
    )
    thrust_axis: int = parameter(AXIS, "number of the axis for the thrust", THRUST, "axes/thrust")
    max_pitch: float = parameter(_TILT, "value at full deflection", 30.0, "max/pitch", live=True)
    max_roll: float = parameter(_TILT, "value at full deflection", 30.0, "max/roll", live=True)
    max_yaw_rate: float = parameter(
        Number("deg/s", above=0.0), "value at full deflection", 200.0, "max/yaw_rate", live=True
    )
    max_thrust: float = parameter(
        Number("PWM", above=0.0, maximum=FULL_PWM),
        "value at full deflection",
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

    The thrust is enabled only after its stick has been at zero once. Without a joystick the node is
    silent, and the vehicle's watchdog does the rest.
    """

    parameters_type: type[TeleopParameters] = CmdVelTeleopParameters
    _parameters: TeleopParameters

    def __init__(self) -> None:
        self._is_locked = True

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = handle.publisher("cmd_vel", Twist)
        self._axes = JoyAxes(handle, self._parameters.joy_topic)
        handle.timer(1.0 / self._parameters.rate, self._on_timer)

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


_AXIS = Integer(-256, 256)
_VELOCITY = Number("deg", minimum=-60.0, maximum=60.0)


class QuadrotorTeleopParameters(TeleopParameters):
    """Parameters of `QuadrotorTeleopNode`: axes are numbered from 1, negative if inverted."""

    x_axis: int = parameter(_AXIS, "axis of cmd_vel's linear.x; 0 for none", 4)
    y_axis: int = parameter(_AXIS, "axis of linear.y", 3)
    z_axis: int = parameter(_AXIS, "axis of linear.z, the thrust", 2)
    yaw_axis: int = parameter(_AXIS, "axis of angular.z", 1)
    x_velocity_max: float = parameter(_VELOCITY, "linear.x at full deflection", 2.0, live=True)
    y_velocity_max: float = parameter(_VELOCITY, "linear.y at full deflection", 2.0, live=True)
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
        """Return the sticks; the factor contains the inversion, and is 0 without an axis."""
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

    parameters_type = QuadrotorTeleopParameters


_HEADLIGHT_PARAMETER = "ring/headlightEnable"

_LIMIT = 5.0  #: Longest duration of a service call (s).


class JoystickControllerParameters(JoyParameters):
    """Parameters of `JoystickControllerNode`."""

    has_controller: bool = parameter(
        BOOLEAN,
        "whether a crazyflie_controller takes off and lands",
        False,
        "use_crazyflie_controller",
    )


class JoystickControllerNode(Node[JoystickControllerParameters]):
    """Land, take off, stop in an emergency, or switch the headlight when a button is pressed.

    Takeoff and landing are those of crazyflie_controller, if there is one.
    """

    def __init__(self) -> None:
        self._buttons: tuple[int, ...] = ()

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._writer = ParameterWriter(self._switch, handle.error)
        handle.subscribe(self._parameters.joy_topic, Joy, self._on_joy)

    def _on_joy(self, message):
        before, self._buttons = self._buttons, message.buttons
        for button, is_pressed in enumerate(self._buttons):
            was_pressed = button < len(before) and before[button]
            if is_pressed and not was_pressed:
                self._press(button)

    def _press(self, button):
        if button == EMERGENCY:
            self._call("emergency")
        elif button in (LAND, TAKEOFF) and self._parameters.has_controller:
            self._call("land" if button == LAND else "takeoff")
        elif button == HEADLIGHT:
            self._writer.set(_HEADLIGHT_PARAMETER, None)

    def _switch(self, name, _):
        # In the writer's thread: the master may be slow, and no other button may wait for it.
        is_on = self._handle.get_param(name, Integer(0, 255), 0)
        self._handle.set_param(name, 0 if is_on else 1)
        self._handle.submit(self._call, "update_params", UpdateParams, UpdateParamsRequest([name]))

    def _call(self, service, service_type=Empty, request=None):
        self._handle.info(f"{self._handle.resolve(service)} requested")

        def report(done):
            error = done.exception()
            if error is not None:
                self._handle.error(f"{self._handle.resolve(service)} failed: {error}")

        answer = self._handle.call_service(service, service_type, request or EmptyRequest(), _LIMIT)
        answer.add_done_callback(report)
