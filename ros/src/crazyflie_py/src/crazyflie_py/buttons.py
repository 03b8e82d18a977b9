"""The button for which scripts wait: that of a joystick, or any key."""

import functools
import glob
import logging
import os
import select
import sys
import termios
import tty
from collections.abc import Callable, Iterator, Sequence

from crazyflie_demo.joystick import EVENT, Joystick, open_joystick
from crazyflie_py.swarm import TimeHelper

_log = logging.getLogger(__name__)

BUTTON = 5  #: Number of Crazyswarm's button: right shoulder of a gamepad.
BUTTONS = (3, 4, 5)  #: Buttons of `Input.checkIfAnyButtonIsPressed`.
#: Time after which --sim presses the button itself, without a joystick and a terminal (s).
UNATTENDED_DELAY = 3.0
_POLL_PERIOD = 0.01  #: s.
_KEY = [0] * BUTTON + [1]  #: Buttons that are reported for a key.


#: A source of button events: 1 for each button that is pressed, else 0; waits 0.01 s at most.
Poll = Callable[[], Sequence[int]]


class JoystickDevice:
    """A joystick of Linux, /dev/input/js0 or another."""

    def __init__(self, path: str):
        self._path = path
        self._file = open_joystick(path)
        self._joystick = Joystick()

    def poll(self) -> Sequence[int]:
        """Return the buttons; RuntimeError when the joystick was pulled out."""
        if select.select([self._file], [], [], _POLL_PERIOD)[0]:
            try:
                data = os.read(self._file, 64 * EVENT.size)
            except OSError as error:
                raise self._lost(error.strerror) from None
            if not data:
                raise self._lost("end of file")
            self._joystick.feed(data)
        return self._joystick.state()[1]

    def _lost(self, reason):
        return RuntimeError(f"swarm.input: the joystick {self._path} was disconnected ({reason})")


def _poll_keyboard():
    """Return the button as pressed if a key was typed into the terminal."""
    file = sys.stdin.fileno()
    settings = termios.tcgetattr(file)
    tty.setcbreak(file, termios.TCSANOW)
    try:
        is_typed = bool(select.select([file], [], [], _POLL_PERIOD)[0])
        return _KEY if is_typed and os.read(file, 1024) else []
    finally:
        termios.tcsetattr(file, termios.TCSANOW, settings)


def _unattended(time: Callable[[], float]) -> Iterator[Sequence[int]]:
    """Yield the button as pressed once, `UNATTENDED_DELAY` after the first request; repeat."""
    while True:
        begin = time()
        while time() < begin + UNATTENDED_DELAY:
            yield []
        yield _KEY


class Input:
    """``swarm.input``: a joystick, or else the terminal's keys.

    Without both the button is pressed automatically if it ``is_simulated``; otherwise methods raise
    RuntimeError, since a wait would never end. ``devices`` is a pattern of joysticks, of which the
    first that can be read is used.
    """

    def __init__(
        self, time_helper: TimeHelper, is_simulated: bool, devices: str = "/dev/input/js*"
    ):
        self._time_helper = time_helper
        self._is_simulated = is_simulated
        self._pattern = devices

    @functools.cached_property
    def _poll(self) -> Poll:
        # Not before it is needed: most scripts need none.
        for path in sorted(glob.glob(self._pattern)):
            try:
                return JoystickDevice(path).poll
            except OSError as error:
                _log.warning("swarm.input: cannot open %s: %s", path, error.strerror)
        if _has_terminal():
            return _poll_keyboard
        if self._is_simulated:
            _log.warning(
                "swarm.input: neither a joystick nor a terminal is connected; the button is "
                "pressed %g s after the wait begins",
                UNATTENDED_DELAY,
            )
            return _unattended(self._time_helper.time).__next__
        raise RuntimeError(
            f"swarm.input: neither a joystick ({self._pattern}) nor a terminal is connected; "
            "expected one of them"
        )

    def checkIfButtonIsPressed(self) -> bool:
        """Return whether the button is pressed: number 5 of the joystick, or any key."""
        buttons = self._poll()
        return len(buttons) > BUTTON and buttons[BUTTON] == 1

    def checkIfAnyButtonIsPressed(self) -> list[int] | None:
        """Return all buttons if number 3, 4 or 5 is pressed, else None."""
        buttons = list(self._poll())
        return buttons if any(buttons[i] for i in BUTTONS if i < len(buttons)) else None

    def waitUntilButtonPressed(self) -> None:
        """Wait until the button is pressed and released."""
        self._wait_until(self.checkIfButtonIsPressed)
        self._wait_until(lambda: not self.checkIfButtonIsPressed())

    def waitUntilAnyButtonPressed(self) -> list[int]:
        """Wait until button 3, 4 or 5 is pressed and released; return all as they were."""
        pressed = self._wait_until(self.checkIfAnyButtonIsPressed)
        self.waitUntilAllButtonsReleased()
        return pressed

    def waitUntilAllButtonsReleased(self) -> None:
        """Wait until none of the buttons 3, 4, 5 is pressed."""
        self._wait_until(lambda: not self.checkIfAnyButtonIsPressed())

    def _wait_until(self, condition):
        while not (result := condition()) and not self._time_helper.isShutdown():
            self._time_helper.sleep(_POLL_PERIOD)
        return result


def _has_terminal():
    try:
        file = sys.stdin.fileno()
        # A process in the background would be stopped.
        return os.isatty(file) and os.tcgetpgrp(file) == os.getpgrp()
    except (AttributeError, OSError, ValueError):
        return False
