"""ROS interface of a keyboard that stands for a joystick."""

import os
import select
import sys
import termios
import tty
from collections import deque

from sensor_msgs.msg import Joy

from crazyflie_demo.keyboard import BUTTONS, HELP, Keyboard
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import Number

_PERIOD = 0.05
"""Time between two messages, s."""


class KeyboardNode(Node):
    """Publish what is typed on the terminal as if a joystick had done it."""

    def __init__(self):
        super().__init__()
        self._keyboard = None
        self._presses = deque()
        self._terminal = None
        self._settings = None
        self._publisher = None

    def initialize(self, handle) -> bool:
        """See `Node.initialize`."""
        if not sys.stdin.isatty():
            handle.error(
                "standard input is no terminal; start this node with rosrun, not with roslaunch"
            )
            return False
        return super().initialize(handle)

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        self._keyboard = Keyboard(
            deflection=handle.param("deflection", Number(above=0.0, maximum=1.0), 0.5),
            lift_step=handle.param("lift_step", Number(minimum=0.0, maximum=1.0), 0.0),
        )

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        self._publisher = handle.publisher("joy", Joy)
        # Hands do not live by simulated time.
        handle.timer(_PERIOD, self._on_timer, steady=True)
        print(HELP, flush=True)
        self._terminal = sys.stdin.fileno()
        self._settings = termios.tcgetattr(self._terminal)
        # Keys come one by one and are not echoed; Ctrl-C remains what it is.
        tty.setcbreak(self._terminal)

    def shutdown(self) -> None:
        """Give the terminal back as it was."""
        if self._settings is not None:
            termios.tcsetattr(self._terminal, termios.TCSADRAIN, self._settings)

    def _on_timer(self):
        now = self._handle.time()
        self._presses.extend(self._keyboard.feed(self._read(), now))
        # A press is one message long.
        buttons = [0] * BUTTONS
        if self._presses:
            buttons[self._presses.popleft()] = 1
        message = Joy(axes=self._keyboard.axes(now), buttons=buttons)
        message.header.stamp = self._handle.stamp()
        message.header.frame_id = "keyboard"
        self._publisher.publish(message)

    def _read(self):
        if not select.select([self._terminal], [], [], 0.0)[0]:
            return ""
        data = os.read(self._terminal, 1024)
        if not data:
            # The terminal is gone: there will be no more keys, not even the one for landing.
            self._handle.error("the terminal has been closed")
            self._handle.end(1)
        return data.decode(errors="ignore")
