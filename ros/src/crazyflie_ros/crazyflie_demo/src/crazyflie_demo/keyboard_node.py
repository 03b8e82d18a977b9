"""ROS interface of a keyboard in place of a joystick."""

import os
import select
import sys
import termios
import tty
from collections import deque
from typing import Any

from sensor_msgs.msg import Joy
from typing_extensions import override

from crazyflie_demo.joystick import BUTTONS
from crazyflie_demo.keyboard import HELP, Keyboard
from crazyflie_demo.node_parts import REPEATED
from crazyflie_utils import Node, NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import Number
from crazyflie_utils.vectors import stamped

_PERIOD = 0.05  #: Time between two messages, s.


class KeyboardParameters(Parameters):
    """Parameters of `KeyboardNode`."""

    deflection: float = parameter(
        Number(above=0.0, maximum=1.0), "deflection of an axis by a key", 0.5, live=True
    )
    lift_step: float = parameter(
        Number(minimum=0.0, maximum=1.0),
        "0: w and s move their axis while held; otherwise each press moves it by this step, and "
        "it is kept",
        0.0,
    )


class KeyboardNode(Node[KeyboardParameters]):
    """Publish the keys of the terminal as the axes and buttons of a joystick."""

    sources = "a keyboard"

    def __init__(self) -> None:
        self._presses: deque[int] = deque()
        self._settings: list[Any] | None = None

    @override
    def initialize(self, handle: NodeHandle) -> bool:
        if not sys.stdin.isatty():
            handle.error(
                "standard input is not a terminal; start this node with rosrun, not with roslaunch"
            )
            return False
        return super().initialize(handle)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._keyboard = Keyboard(self._parameters.lift_step)
        self._publisher = handle.publisher("joy", Joy)
        # Real time, since hands do not follow simulated time.
        handle.timer(_PERIOD, self._on_timer, steady=True)
        print(HELP, flush=True)
        self._terminal = sys.stdin.fileno()
        self._settings = termios.tcgetattr(self._terminal)
        # Keys are read one by one and are not echoed; Ctrl-C still interrupts.
        tty.setcbreak(self._terminal)

    @override
    def shutdown(self) -> None:
        if self._settings is not None:
            termios.tcsetattr(self._terminal, termios.TCSADRAIN, self._settings)

    def _on_timer(self):
        now, deflection = self._handle.time(), self._parameters.deflection
        self._presses.extend(self._keyboard.feed(self._read(), now, deflection))
        # A press is reported in one message.
        buttons = [0] * BUTTONS
        if self._presses:
            buttons[self._presses.popleft()] = 1
        stamp, axes = self._handle.stamp(), self._keyboard.axes(now)
        self._publisher.publish(stamped(Joy, stamp, REPEATED, axes=axes, buttons=buttons))

    def _read(self):
        if not select.select([self._terminal], [], [], 0.0)[0]:
            return ""
        data = os.read(self._terminal, 1024)
        if not data:
            # The terminal was closed: no more keys will come, not even the one for landing.
            self._handle.error("the terminal has been closed")
            self._handle.end(1)
        return data.decode(errors="ignore")
