"""Whether a vehicle is flown by its high-level commander."""

import math
from typing import TYPE_CHECKING

from crazyflie_driver.setpoint_topics import SetpointTopics
from crazyflie_model.supervisor import SupervisorState
from crazyflie_utils import NodeHandle

if TYPE_CHECKING:
    from crazyflie_driver.vehicle import DriverVehicle

_REPORT_LAG = 0.2
"""How old a state may be, s: the firmware's supervisor runs at 25 Hz, and is logged at 10 Hz."""


class FlightState:
    """Tell flights by the high-level commander from all else that has FLYING in it.

    FLYING holds until 2 s after the motors have stopped, and a landing that is commanded then
    starts them again: a flight needs HIGH_LEVEL_ACTIVE, too. Of firmware that does not report it
    (before protocol 12), what was sent last decides.

    Parameters
    ----------
    handle : NodeHandle
    vehicle : DriverVehicle
    setpoints : SetpointTopics
    """

    def __init__(self, handle: NodeHandle, vehicle: "DriverVehicle", setpoints: SetpointTopics):
        self._handle = handle
        self._vehicle = vehicle
        self._setpoints = setpoints
        # When the planner was last told to move, and when it holds the motors off.
        self._planned, self._plan_end = -math.inf, math.inf

    def motion_sent(self) -> None:
        """Take note that the planner is told to move."""
        self._planned, self._plan_end = self._handle.time(), math.inf

    def end_accepted(self, duration: float) -> None:
        """Take note that the planner holds the motors off after a duration (s)."""
        self._plan_end = self._handle.time() + duration

    def is_flight(self, state: SupervisorState | None) -> bool:
        """Return whether a state, None if unknown, is a flight by the high-level commander."""
        return state is not None and SupervisorState.FLYING in state and self._may_move(state)

    def is_on_ground(self) -> bool:
        """Return whether neither setpoints nor planner can have the motors run; blocks.

        Raises
        ------
        LinkLostError
        """
        state = self._vehicle.read_state()
        is_streamed = self._setpoints.is_flight
        latest = max(self._planned, self._setpoints.last_time if is_streamed else -math.inf)
        if state is None or self._handle.time() - latest < _REPORT_LAG:
            return False
        return not (self._may_move(state) or (is_streamed and SupervisorState.FLYING in state))

    def _may_move(self, state):
        # Whether the planner may give the motors anything to do.
        if state.reports_planner:
            return SupervisorState.HIGH_LEVEL_ACTIVE in state
        is_latest = self._planned >= self._setpoints.last_time
        return is_latest and self._handle.time() < self._plan_end
