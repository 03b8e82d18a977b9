"""ROS interface of a joystick."""

import errno
import os

from sensor_msgs.msg import Joy

from crazyflie_demo.joystick import EVENT, Joystick
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import TEXT, Number

_POLL_PERIOD = 0.01
"""Time between two looks at the device, s."""

_OPEN_PERIOD = 1.0
"""Time between two tries to open it, s."""

_EVENTS = 512
"""Events that are read at most at one time."""

_HINTS = {
    errno.ENOENT: "is it plugged in, and does the parameter dev name it?",
    errno.EACCES: "may this user read it? He usually has to be in the group input",
}


class JoyNode(Node):
    """Publish what a joystick does.

    The device is looked for again and again. When it is unplugged, all axes and
    buttons are said to be at zero.
    """

    def __init__(self):
        super().__init__()
        self._dev = None
        self._repeat_period = None
        self._joystick = None
        self._file = None
        self._tried = None
        self._said = None
        self._publisher = None

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        self._dev = handle.param("dev", TEXT, "/dev/input/js0")
        deadzone = handle.param("deadzone", Number(minimum=0.0, maximum=0.9), 0.05)
        rate = handle.param("autorepeat_rate", Number("Hz", minimum=0.0, maximum=100.0), 20.0)
        self._repeat_period = 1.0 / rate if rate > 0.0 else None
        self._joystick = Joystick(deadzone)

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        self._publisher = handle.publisher("joy", Joy)
        # Hands do not live by simulated time.
        handle.timer(_POLL_PERIOD, self._poll, steady=True)
        if self._repeat_period is not None:
            handle.timer(self._repeat_period, self._repeat, steady=True)
        self._open()

    def shutdown(self) -> None:
        """See `Node.shutdown`."""
        if self._file is not None:
            os.close(self._file)

    def _open(self):
        self._tried = self._handle.time()
        try:
            self._file = os.open(self._dev, os.O_RDONLY | os.O_NONBLOCK)
        except OSError as error:
            hint = _HINTS.get(error.errno, "")
            self._handle.warn(f"cannot open {self._dev}: {error.strerror}; {hint}", throttle=10.0)
        else:
            self._handle.info(f"reading {self._dev}")

    def _poll(self):
        if self._file is None:
            if self._handle.time() - self._tried >= _OPEN_PERIOD:
                self._open()
            return
        try:
            data = os.read(self._file, _EVENTS * EVENT.size)
        except BlockingIOError:
            return
        except OSError as error:
            self._lose(error)
            return
        for state in self._joystick.feed(data) if data else []:
            self._publish(state)

    def _lose(self, error):
        self._handle.error(f"lost {self._dev}: {error.strerror}; all axes are taken for released")
        os.close(self._file)
        self._file = None
        self._tried = self._handle.time()
        self._publish(self._joystick.release())

    def _repeat(self):
        # Silence of the repetition tells others that there is no joystick.
        if self._file is not None and self._said is not None:
            self._publish(self._joystick.state())

    def _publish(self, state):
        self._said = state
        message = Joy(axes=state[0], buttons=state[1])
        message.header.stamp = self._handle.stamp()
        message.header.frame_id = "joy"
        self._publisher.publish(message)
