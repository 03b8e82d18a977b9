"""The commander: priority of streamed setpoints over the high-level commander."""

from crazyflie_virtual.firmware.planner import Planner
from crazyflie_virtual.firmware.states import Estimate, Setpoint

#: Priorities, named as in the firmware.
PRIORITY_DISABLE, PRIORITY_HIGHLEVEL, PRIORITY_CRTP = 0, 1, 2


class Commander:
    """The setpoint with the highest priority.

    A streamed setpoint stops the high-level commander and overrides it until
    `relax_priority`: neither age nor a new client ends that. Afterwards the high-level
    commander holds the motors off until its next command.
    """

    def __init__(self, planner: Planner):
        self._planner = planner
        self.setpoint = Setpoint()
        #: Of the setpoint: `PRIORITY_DISABLE`, `PRIORITY_HIGHLEVEL` or `PRIORITY_CRTP`.
        self.priority = PRIORITY_DISABLE
        #: Parameter that the firmware has without effect: the commander is on.
        self.high_level_enabled = 1

    def stream(self, setpoint: Setpoint) -> None:
        """Take a setpoint from the client."""
        self.setpoint = setpoint
        self.priority = PRIORITY_CRTP
        self._planner.stop()

    def relax_priority(self, estimate: Estimate) -> None:
        """Permit high-level setpoints, beginning at the estimated state."""
        self.priority = min(self.priority, PRIORITY_HIGHLEVEL)
        self._planner.tell_state(estimate)

    def update_from_planner(self, time: float, estimate: Estimate) -> None:
        """Take the high-level commander's setpoint for ``time`` (s)."""
        setpoint = self._planner.setpoint(time, estimate)
        if setpoint is not None and self.priority <= PRIORITY_HIGHLEVEL:
            self.setpoint = setpoint
            self.priority = PRIORITY_HIGHLEVEL

    def age(self, time: float) -> float:
        """Return how old the setpoint is at ``time``, s."""
        return time - self.setpoint.time
