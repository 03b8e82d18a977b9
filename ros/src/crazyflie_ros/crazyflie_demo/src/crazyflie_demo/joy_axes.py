"""The axes of a joystick at present."""

import math
from collections.abc import Sequence

JOY_LIMIT = 0.5
"""How long, in s, the last message of a joystick counts: joy_node repeats it all the time."""


class JoyAxes:
    """The axes that were received last, as long as they are fresh."""

    def __init__(self) -> None:
        self._axes: tuple[float, ...] = ()
        self._received: float | None = None

    def update(self, axes: Sequence[float], time: float) -> None:
        """Take the axes of a message that has come at ``time`` (s)."""
        self._axes = tuple(axes)
        self._received = time

    def is_fresh(self, time: float) -> bool:
        """Tell whether the joystick is alive at ``time`` (s)."""
        return self._received is not None and time - self._received <= JOY_LIMIT

    def axis(self, index: int, time: float) -> float:
        """Return an axis, -1 to 1; 0 if there is none, or the joystick is silent."""
        if not self.is_fresh(time) or index >= len(self._axes):
            return 0.0
        value = self._axes[index]
        return max(-1.0, min(1.0, value)) if math.isfinite(value) else 0.0
