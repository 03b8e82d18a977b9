"""Whether the driver is connected to the vehicle, and this can fly, as the driver publishes."""

import math

from crazyflie_model.supervisor import SupervisorState

MAX_CONNECTION_AGE = 3.0  #: An older message does not count, s: the driver sends one every second.


class DriverConnection:
    """What the driver has published last; times are s of one clock."""

    def __init__(self) -> None:
        self._is_connected = False
        self._time: float | None = None
        self._state, self._state_time = SupervisorState(0), -math.inf
        self._is_emergency = False

    def update(self, now: float, is_connected: bool) -> None:
        """Take note of what the driver has published."""
        self._time, self._is_connected = now, is_connected

    def update_state(self, now: float, state: SupervisorState, is_emergency: bool) -> None:
        """Take note of the vehicle's state, and whether the driver's emergency stop is latched."""
        self._state_time, self._state, self._is_emergency = now, state, is_emergency

    def cannot_fly(self, now: float) -> str:
        """Return why the vehicle cannot take off; empty if it can, or nothing is known."""
        if now - self._state_time > MAX_CONNECTION_AGE:
            return ""
        if self._is_emergency:
            return "the vehicle was stopped by emergency; remove it, restart it and add it again"
        if self._state.faults:
            return f"the vehicle cannot fly, its state is: {self._state.words()}; restart it"
        return ""

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
