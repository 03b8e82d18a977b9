"""The topic that says whether the driver is connected to a vehicle."""

from std_msgs.msg import Bool

from crazyflie_utils import NodeHandle

PERIOD = 1.0
"""How often it is repeated, s: its absence shows that the driver is gone."""


class ConnectedTopic:
    """Publish whether a vehicle is connected: when that changes, and again and again.

    Parameters
    ----------
    handle : NodeHandle
    name : str
        Of the topic, absolute.
    """

    def __init__(self, handle: NodeHandle, name: str):
        self._publisher = handle.publisher(name, Bool, latch=True)
        self._is_connected = False
        self._publish()
        handle.timer(PERIOD, self._publish)

    def update(self, is_connected: bool) -> None:
        """Publish what is new."""
        if is_connected != self._is_connected:
            self._is_connected = is_connected
            self._publish()

    def _publish(self) -> None:
        self._publisher.publish(Bool(self._is_connected))
