"""A joystick: its events as Linux encodes them (linux/joystick.h), its axes and buttons."""

import contextlib
import errno
import fcntl
import os
import stat
import struct

#: Axes, with the right stick for tilt: left, up and forward are positive.
ROLL, PITCH, YAW, THRUST = 3, 4, 0, 1
LAND, EMERGENCY, TAKEOFF, HEADLIGHT = 0, 1, 2, 4  #: Buttons.
AXES, BUTTONS = 8, 11  #: Number of axes and buttons of a gamepad.


#: struct js_event: time in ms, value, type, number of the axis or button.
EVENT = struct.Struct("=IhBB")
BUTTON, AXIS = 0x01, 0x02  #: Types of events.
INITIAL = 0x80  #: Flag in the type of events that report the state when the device is opened.
_FULL = 32767  #: Value of an axis at its end.
JoystickState = tuple[list[float], list[int]]  #: Axes and buttons.


#: JSIOCGVERSION of linux/joystick.h: only the driver of joysticks answers it.
_GET_VERSION = 0x80046A01


def open_joystick(path: str) -> int:
    """Return the file of a joystick's device, or of a FIFO in its place; reading does not block.

    OSError: it cannot be opened, or is something else, such as /dev/input/event0.
    """
    file = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    if stat.S_ISFIFO(os.fstat(file).st_mode):
        return file
    with contextlib.suppress(OSError):
        fcntl.ioctl(file, _GET_VERSION, bytes(4))
        return file
    os.close(file)
    raise OSError(errno.ENOTTY, "it is not a joystick, as /dev/input/js0 is")


class Joystick:
    """Axes and buttons of a joystick, as far as there were events of them.

    Axes are -1 to 1, left and up positive; within the deadzone (a fraction, < 1) of the centre they
    are 0. A pressed button is 1.
    """

    def __init__(self) -> None:
        self.axes: list[float] = []
        self.buttons: list[int] = []
        self._rest = b""

    def feed(self, data: bytes, deadzone: float = 0.0) -> list[JoystickState]:
        """Return the states that follow from data of the device.

        There is one after every change of a button, so that no short press is lost, and the last
        one.
        """
        data = self._rest + data
        whole = len(data) - len(data) % EVENT.size
        self._rest = data[whole:]
        states = []
        is_complete = True
        for _, value, event_type, number in EVENT.iter_unpack(data[:whole]):
            if event_type & ~INITIAL == AXIS:
                _put(self.axes, number, _deflection(value, deadzone), 0.0)
            elif event_type & ~INITIAL == BUTTON:
                _put(self.buttons, number, int(value != 0), 0)
            else:
                continue
            is_complete = event_type == BUTTON
            if is_complete:
                states.append(self.state())
        return states if is_complete else [*states, self.state()]

    def release(self) -> JoystickState:
        """Return the neutral state, all zero, for a joystick that has been unplugged."""
        self.axes = [0.0] * len(self.axes)
        self.buttons = [0] * len(self.buttons)
        self._rest = b""
        return self.state()

    def state(self) -> JoystickState:
        """Return the state (axes, buttons), in new lists."""
        return list(self.axes), list(self.buttons)


def _deflection(value, deadzone):
    # In Linux, right and down are positive.
    part = max(-1.0, min(1.0, -value / _FULL))
    beyond = max(0.0, abs(part) - deadzone) / (1.0 - deadzone)
    return beyond if part > 0.0 else -beyond if beyond else 0.0


def _put(values, number, value, neutral):
    values.extend([neutral] * (number + 1 - len(values)))
    values[number] = value
