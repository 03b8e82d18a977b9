"""ROS interface of a joystick's buttons: services of the vehicle."""

from sensor_msgs.msg import Joy
from std_srvs.srv import Empty, EmptyRequest
from typing_extensions import override

from crazyflie_demo.gamepad import EMERGENCY, HEADLIGHT, LAND, TAKEOFF
from crazyflie_demo.parameters import JoyParameters
from crazyflie_driver.srv import UpdateParams, UpdateParamsRequest
from crazyflie_utils import Node, NodeHandle, parameter
from crazyflie_utils.parameters.types import BOOLEAN, Integer
from crazyflie_utils.parameters.writer import ParameterWriter

_HEADLIGHT_PARAMETER = "ring/headlightEnable"

_LIMIT = 5.0  #: How long a service may take, s.


class JoystickControllerParameters(JoyParameters):
    """Parameters of `JoystickControllerNode`."""

    has_controller: bool = parameter(
        BOOLEAN,
        "whether a crazyflie_controller is there to take off and land",
        False,
        "use_crazyflie_controller",
    )


class JoystickControllerNode(Node):
    """Land, take off, stop in an emergency, switch the headlight: at the press of a button.

    Takeoff and landing are those of crazyflie_controller, if there is one.
    """

    def __init__(self) -> None:
        self._buttons: tuple[int, ...] = ()

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(JoystickControllerParameters)

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
