"""Whether the driver is connected to the vehicle, as it publishes itself."""

MAX_CONNECTION_AGE = 3.0
"""An older message does not count, s: the driver sends one every second."""


class DriverConnection:
    """What the driver has published last; times are s of one clock."""

    def __init__(self) -> None:
        self._is_connected = False
        self._time: float | None = None

    def update(self, now: float, is_connected: bool) -> None:
        """Take note of what the driver has published."""
        self._time, self._is_connected = now, is_connected

    def refusal(self, now: float, topic: str) -> str:
        """Return why nothing can be sent to the vehicle; empty if it can.

        ``topic`` is its absolute name, below the vehicle's namespace.
        """
        is_recent = self._time is not None and now - self._time <= MAX_CONNECTION_AGE
        if is_recent and self._is_connected:
            return ""
        prefix = topic.rpartition("/")[0].strip("/")
        text = "false" if is_recent else "nothing"
        return (
            f"the driver is not connected to the vehicle, {text} on {topic}; is the vehicle on? "
            "It is added by: roslaunch crazyflie_driver crazyflie_add.launch uri:=ADDRESS "
            f"tf_prefix:={prefix}"
        )
