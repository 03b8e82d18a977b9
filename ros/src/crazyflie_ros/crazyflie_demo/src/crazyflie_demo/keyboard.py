"""A keyboard in place of a joystick: keys become axes and buttons.

A terminal reports a key when it is pressed and repeats it while it is held, but does not report its
release. So a deflection lasts until the next repetition is due.
"""

from collections.abc import Iterator
from typing import NamedTuple

from crazyflie_demo import joystick
from crazyflie_demo.joystick import PITCH, ROLL, THRUST, YAW

#: Time for which a key is treated as held after its press (s): repetition begins late.
FIRST_HOLD = 0.6
REPEAT_HOLD = 0.15  #: Time for which a key is treated as held after a repetition (s).

_DEFLECTIONS = {
    "\x1b[A": (PITCH, 1.0),
    "\x1b[B": (PITCH, -1.0),
    "\x1b[D": (ROLL, 1.0),
    "\x1b[C": (ROLL, -1.0),
    "w": (THRUST, 1.0),
    "s": (THRUST, -1.0),
    "a": (YAW, 1.0),
    "d": (YAW, -1.0),
}

_PRESSES = {
    "t": joystick.TAKEOFF,
    "l": joystick.LAND,
    " ": joystick.EMERGENCY,
    "h": joystick.HEADLIGHT,
}

_RELEASE = "x"

HELP = """\
t  take off        arrows  ahead, back, left, right
l  land            w s     up, down
h  headlight       a d     turn left, right
x  let all go      space   EMERGENCY STOP          Ctrl-C  end"""


class _Deflection(NamedTuple):
    value: float
    until: float


class Keyboard:
    """Axes and buttons that keys move.

    A key moves its axis. With a lift step of 0, so do w and s; otherwise they change the thrust by
    this step, from 0 to 1, and it is kept.
    """

    def __init__(self, lift_step: float = 0.0):
        self._lift_step = lift_step
        self._thrust = 0.0
        self._held: dict[int, _Deflection] = {}
        self._rest = ""

    def feed(self, text: str, time: float, deflection: float = 1.0) -> list[int]:
        """Return the buttons that were pressed by text that was typed until ``time`` (s).

        A key moves its axis to the deflection, up to 1.
        """
        presses = []
        for key in self._keys(text):
            if key in _PRESSES:
                presses.append(_PRESSES[key])
            if key in (_RELEASE, " "):
                self._held.clear()
                self._thrust = 0.0
            if key in _DEFLECTIONS:
                axis, direction = _DEFLECTIONS[key]
                self._deflect(axis, direction, direction * deflection, time)
        return presses

    def axes(self, time: float) -> list[float]:
        """Return the axes at ``time`` (s)."""
        axes = [0.0] * joystick.AXES
        for axis, held in self._held.items():
            if time < held.until:
                axes[axis] = held.value
        if self._lift_step > 0.0:
            axes[THRUST] = self._thrust
        return axes

    def _deflect(self, axis, direction, value, time):
        if axis == THRUST and self._lift_step > 0.0:
            self._thrust = min(max(self._thrust + direction * self._lift_step, 0.0), 1.0)
            return
        before = self._held.get(axis)
        if before is not None and time < before.until and before.value == value:
            until = max(time + REPEAT_HOLD, before.until)
        else:
            until = time + FIRST_HOLD
        self._held[axis] = _Deflection(value, until)

    def _keys(self, text: str) -> Iterator[str]:
        text = self._rest + text
        self._rest = ""
        while text:
            if text in ("\x1b", "\x1b[", "\x1bO"):
                # The rest of an arrow key's sequence may not have arrived.
                self._rest = text
                return
            if text[:2] in ("\x1b[", "\x1bO"):
                yield f"\x1b[{text[2]}"
                text = text[3:]
            else:
                yield text[0].lower()
                text = text[1:]
