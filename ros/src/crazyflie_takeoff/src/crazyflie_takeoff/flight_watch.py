"""What is wrong with a flight: why it is ended, and what is passed on of its controls."""

import math

from crazyflie_takeoff.callers import OVERLAP, Callers
from crazyflie_takeoff.control_limits import ClimbLimit, RunGaps, in_range
from crazyflie_takeoff.descent_watch import DescentWatch
from crazyflie_takeoff.limits import Limits, Persistence, Walls
from crazyflie_takeoff.motion import Motion
from crazyflie_takeoff.safe_control import Setpoint

HANDOVER = 3
"""So many changes of the controller are a handover from one to the other."""


class FlightWatch:
    """Keeps the controls of a flight within limits, and notices those that are not to be obeyed.

    Parameters
    ----------
    limits : Limits

    Attributes
    ----------
    walls : Walls
    gaps : RunGaps
    is_tilted : bool
        Whether the vehicle is tilted as only one that crashes is.
    """

    def __init__(self, limits: Limits):
        self.walls = Walls(limits)
        self.gaps = RunGaps()
        self.is_tilted = False
        self._position_limit = Persistence()
        self._climb = ClimbLimit(limits.climb)
        self._descent = DescentWatch()
        # The server is silent in flight: another one at once is a second one.
        self._takeoff_callers = Callers("takeoff controls", 0)
        self._commanded_callers = Callers("commanded controls", HANDOVER)

    @property
    def is_calm(self) -> bool:
        """Whether nothing has been measured that would stop the motors."""
        return not (self.is_tilted or self._position_limit.is_wrong)

    @property
    def contention(self) -> str:
        """In words, that two nodes publish the same controls; empty if they do not."""
        return self._takeoff_callers.complaint or self._commanded_callers.complaint

    def measure(self, motion: Motion, age: float) -> None:
        """Take a state that was measured ``age`` s ago."""
        self._position_limit.measure(self.walls.complaint(motion.position), age)

    def hear_takeoff(self, time: float, caller: str, is_on_ground: bool) -> None:
        """Take note of who has sent a takeoff control at ``time`` (s)."""
        self._takeoff_callers.hear(time, caller, OVERLAP if is_on_ground else math.inf)

    def hear_commanded(self, time: float, caller: str) -> None:
        """Take note of who has sent a commanded control at ``time`` (s)."""
        self._commanded_callers.hear(time, caller)

    def allowed(
        self,
        control: Setpoint,
        lowest: float,
        hover: float,
        motion: Motion | None,
        highest: float,
        is_landing: bool,
        is_ramp: bool,
    ) -> Setpoint:
        """Return what is passed on of a control; see `in_range`, `ClimbLimit` and `RunGaps`."""
        control = in_range(control, lowest)
        thrust = self._climb.apply(control.thrust, hover, motion, highest, is_landing)
        speed = 0.0 if motion is None else motion.velocity[2]
        return self.gaps.apply(control._replace(thrust=thrust), hover, speed, is_ramp)

    def advance(self, time: float, step: float, height: float | None) -> tuple[str, str]:
        """Let time pass until ``time``, of which ``step`` (s) counts.

        Parameters
        ----------
        time, step : float
            s.
        height : float or None
            Of a vehicle that its controller is to bring down, m; None of any other.

        Returns
        -------
        crash, objection : str
            Why the motors are stopped in the air, and why the vehicle is landed; or empty.
        """
        self.gaps.run(time)
        for callers in (self._takeoff_callers, self._commanded_callers):
            callers.advance(time)
        crash = self._position_limit.advance(step)
        if self.is_tilted:
            crash = "the vehicle has tilted over"
        objection = self._climb.advance(step) or self.gaps.complaint
        return crash, self._descent.advance(step, height) or objection
