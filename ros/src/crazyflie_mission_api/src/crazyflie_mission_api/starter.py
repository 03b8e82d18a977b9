"""Several vehicles that begin at the same moment."""

from std_msgs.msg import String

from crazyflie_mission_api.high_level_parameters import START_TOPIC
from crazyflie_utils import NodeHandle

_STEP = 0.02
"""Who is to start within such a time, s, is named in one message."""


class Starter:
    """Names nodes that are to start, all those of a moment in one message.

    Parameters
    ----------
    handle : NodeHandle
    """

    def __init__(self, handle: NodeHandle):
        self._handle = handle
        self._publisher = handle.publisher(START_TOPIC, String)
        self._names: list[str] = []
        handle.timer(_STEP, self._on_timer)

    def start(self, node: str) -> None:
        """Have a `HighLevelNode` start what was uploaded to it."""
        self._handle.submit(lambda: self._names.append(node))

    def _on_timer(self):
        if self._names:
            names, self._names = self._names, []
            self._publisher.publish(String(" ".join(names)))
