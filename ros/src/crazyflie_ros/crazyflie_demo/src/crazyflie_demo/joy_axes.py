"""The axes of a joystick at present, for nodes that follow them."""

import math

from sensor_msgs.msg import Joy

from crazyflie_utils import NodeHandle

JOY_LIMIT = 0.5
"""How long, in s, the last message counts of a joystick that is repeated all the time."""

REPEATED = "repeated"
"""frame_id of a Joy whose publisher promises the next one well within `JOY_LIMIT`.

The field has no other use. Without the promise silence means that the sticks are held still;
with it, that the publisher is stuck, which a connection does not show.
"""


class JoyAxes:
    """The axes that were received last, as long as their source is alive.

    It is alive while it is connected; one that promises to repeat itself (see
    `REPEATED`) must keep the promise, too.

    Parameters
    ----------
    handle : NodeHandle
    topic : str
    """

    def __init__(self, handle: NodeHandle, topic: str):
        self._handle = handle
        self._axes: tuple[float, ...] = ()
        self._expiry = -math.inf
        self._subscriber = handle.subscribe(topic, Joy, self._on_joy)

    def _on_joy(self, message):
        self._axes = tuple(message.axes)
        is_repeated = message.header.frame_id == REPEATED
        self._expiry = self._handle.time() + JOY_LIMIT if is_repeated else math.inf

    def are_alive(self) -> bool:
        """Tell whether there is a joystick at present."""
        if not self._subscriber.has_publishers():
            # What a source said before it went does not count when another one comes.
            self._expiry = -math.inf
        return self._handle.time() <= self._expiry

    def axis(self, index: int) -> float:
        """Return an axis, -1 to 1; 0 if there is none, or no joystick."""
        if not self.are_alive() or index >= len(self._axes):
            return 0.0
        value = self._axes[index]
        return max(-1.0, min(1.0, value)) if math.isfinite(value) else 0.0
