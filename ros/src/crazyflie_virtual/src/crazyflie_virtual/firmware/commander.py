"""Which setpoint holds: streamed ones come before the high-level commander."""

from crazyflie_virtual.firmware.planner import Planner
from crazyflie_virtual.firmware.states import Estimate, Setpoint

NOBODY, HIGH_LEVEL, STREAMED = 0, 1, 2
"""Priorities."""


class Commander:
    """The setpoint that holds.

    A streamed setpoint stops the high-level commander and keeps it out until
    `release`. Nothing else ends that: not age, not a new client. After `release`
    a commander that was not told to do something new holds the motors off.

    Parameters
    ----------
    planner : Planner

    Attributes
    ----------
    setpoint : Setpoint
    priority : int
        Of the setpoint: `NOBODY`, `HIGH_LEVEL` or `STREAMED`.
    high_level_enabled : int
        Parameter that the firmware has without effect: the commander is on.
    """

    def __init__(self, planner: Planner):
        self._planner = planner
        self.setpoint = Setpoint()
        self.priority = NOBODY
        self.high_level_enabled = 1

    def stream(self, setpoint: Setpoint) -> None:
        """Take a setpoint from the client."""
        self.setpoint = setpoint
        self.priority = STREAMED
        self._planner.stop()

    def release(self, estimate: Estimate) -> None:
        """Let the high-level commander take over, from the vehicle's state."""
        self.priority = min(self.priority, HIGH_LEVEL)
        self._planner.tell_state(estimate)

    def update_from_planner(self, time: float, estimate: Estimate) -> None:
        """Take the high-level commander's setpoint for ``time`` (s)."""
        setpoint = self._planner.setpoint(time, estimate)
        if setpoint is not None and self.priority <= HIGH_LEVEL:
            self.setpoint = setpoint
            self.priority = HIGH_LEVEL

    def age(self, time: float) -> float:
        """Return how old the setpoint is at ``time``, s."""
        return time - self.setpoint.time
