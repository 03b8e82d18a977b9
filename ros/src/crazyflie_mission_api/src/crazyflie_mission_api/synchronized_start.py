"""Start of several vehicles by one message."""

from std_msgs.msg import String

from crazyflie_fleet.high_level_parameters import START_TOPIC
from crazyflie_utils import NodeHandle

_STEP = 0.02
"""Vehicles that are to start within this time, s, are named in one message."""


class SynchronizedStart:
    """Publishes the names of the nodes that are to start."""

    def __init__(self, handle: NodeHandle):
        self._handle = handle
        self._publisher = handle.publisher(START_TOPIC, String)
        self._names: list[str] = []
        handle.timer(_STEP, self._on_timer)

    def start(self, node: str) -> None:
        """Have a `HighLevelNode` start its uploaded trajectory 0."""
        self._handle.submit(lambda: self._names.append(node))

    def _on_timer(self):
        if self._names:
            names, self._names = self._names, []
            self._publisher.publish(String(" ".join(names)))
