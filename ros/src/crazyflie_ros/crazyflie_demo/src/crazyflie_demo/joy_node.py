"""ROS interface of a joystick."""

import errno
import os

from sensor_msgs.msg import Joy
from typing_extensions import override

from crazyflie_demo.joystick import EVENT, Joystick, JoystickState, open_joystick
from crazyflie_demo.node_parts import JOY_LIMIT, REPEATED
from crazyflie_utils import Node, NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import FILE, Number
from crazyflie_utils.vectors import stamped

_POLL_PERIOD = 0.01  #: Time between two reads of the device, s.
_OPEN_PERIOD = 1.0  #: Time between two attempts to open the device (s).
_EVENTS = 512  #: Largest number of events that are read at once.

_HINTS = {
    errno.ENOENT: "is it plugged in, and does the parameter dev name it?",
    errno.ENOTTY: "does the parameter dev name it?",
    errno.EACCES: "may this user read it? Usually the user must be in the group input",
}


class JoyNodeParameters(Parameters):
    """Parameters of `JoyNode`."""

    dev: str = parameter(FILE, "the joystick's device", "/dev/input/js0")
    deadzone: float = parameter(
        Number(minimum=0.0, maximum=0.9),
        "fraction of an axis's range about the centre that is read as the centre",
        0.05,
        live=True,
    )
    autorepeat_rate: float = parameter(
        Number("Hz", minimum=0.0, maximum=100.0),
        "rate at which the last message is repeated; 0 for never",
        20.0,
    )


class JoyNode(Node[JoyNodeParameters]):
    """Publish the state of a joystick.

    The device is reopened until that succeeds. When it is unplugged, one message has all axes and
    buttons at zero.
    """

    sources = "a joystick"

    def __init__(self) -> None:
        self._joystick = Joystick()
        self._file: int | None = None
        self._published: JoystickState | None = None

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = handle.publisher("joy", Joy)
        # Real time, since hands do not follow simulated time.
        handle.timer(_POLL_PERIOD, self._poll, steady=True)
        rate = self._parameters.autorepeat_rate
        if rate > 0.0:
            handle.timer(1.0 / rate, self._repeat, steady=True)
        self._open()

    @override
    def shutdown(self) -> None:
        if self._file is not None:
            os.close(self._file)

    def _open(self):
        device = self._parameters.dev
        self._tried = self._handle.time()
        try:
            self._file = open_joystick(device)
        except OSError as error:
            hint = _HINTS.get(error.errno or 0, "")
            self._handle.warn(f"cannot open {device}: {error.strerror}; {hint}", throttle=10.0)
        else:
            self._handle.info(f"reading {device}")

    def _poll(self):
        if self._file is None:
            if self._handle.time() - self._tried >= _OPEN_PERIOD:
                self._open()
            return
        try:
            data = os.read(self._file, _EVENTS * EVENT.size)
        except BlockingIOError:
            # No axis or button has moved.
            return
        except OSError as error:
            self._lose(self._file, error)
            return
        for state in self._joystick.feed(data, self._parameters.deadzone) if data else []:
            self._publish(state)

    def _lose(self, file, error):
        self._handle.error(
            f"lost {self._parameters.dev}: {error.strerror}; all axes are treated as released"
        )
        os.close(file)
        self._file = None
        self._tried = self._handle.time()
        self._publish(self._joystick.release())

    def _repeat(self):
        # Subscribers detect a missing joystick by the missing repetition.
        if self._file is not None and self._published is not None:
            self._publish(self._joystick.state())

    def _publish(self, state):
        self._published = state
        is_repeated = self._parameters.autorepeat_rate > 2.0 / JOY_LIMIT
        frame, (axes, buttons) = REPEATED if is_repeated else "", state
        self._publisher.publish(
            stamped(Joy, self._handle.stamp(), frame, axes=axes, buttons=buttons)
        )
