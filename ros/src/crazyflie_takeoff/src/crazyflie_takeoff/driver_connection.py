"""Whether the driver is connected to the vehicle, as it publishes itself."""

MAX_AGE = 3.0
"""Older news count as none, s: the driver repeats them every second."""


class DriverConnection:
    """The last that was heard from the driver; times are s of one clock."""

    def __init__(self) -> None:
        self._is_connected = False
        self._time: float | None = None

    def update(self, now: float, is_connected: bool) -> None:
        """Take note of what the driver has published."""
        self._time, self._is_connected = now, is_connected

    def refusal(self, now: float, topic: str) -> str:
        """Return why nothing can be sent to the vehicle; empty if it can.

        Parameters
        ----------
        now : float
        topic : str
            Absolute name of the topic, below the vehicle's namespace.
        """
        is_heard = self._time is not None and now - self._time <= MAX_AGE
        if is_heard and self._is_connected:
            return ""
        prefix = topic.rpartition("/")[0].strip("/")
        said = "false" if is_heard else "nothing"
        return (
            f"the driver is not connected to the vehicle, {said} on {topic}; is the vehicle on? "
            "It is added by: roslaunch crazyflie_driver crazyflie_add.launch uri:=ADDRESS "
            f"tf_prefix:={prefix}"
        )
