"""What is wrong with a flight, and why it is ended."""

import math

from crazyflie_takeoff.callers import OVERLAP, Callers
from crazyflie_takeoff.control_limits import ClimbLimit, RunGaps
from crazyflie_takeoff.limits import Debounce, Limits, Walls
from crazyflie_takeoff.motion import MAX_FEEDBACK_AGE, Motion

HANDOVER = 3  #: So many changes of the controller are a handover from one to the other.
#: How long a limit has to be exceeded, s: a single measurement that is wrong is no crash.
CRASH_DURATION = 0.1
DESCENT_TIMEOUT = 1.5  #: How long a vehicle that is to land may stay up, s.
PROGRESS = 0.02  #: Less than this below where it was highest is no descent, m.


class DescentWatch:
    """Notices when a vehicle that is to land does not come down."""

    def __init__(self) -> None:
        self._highest: float | None = None
        self._debounce = Debounce(DESCENT_TIMEOUT)

    def advance(self, step: float, height: float | None) -> str:
        """Let time pass (s); return in words what is wrong, or an empty text.

        ``height`` is in m; None while the vehicle is not to land, or its height is not known.
        """
        complaint = ""
        if height is not None and self._highest is not None and height > self._highest - PROGRESS:
            height = max(self._highest, height)
            complaint = f"the vehicle has not come down for {DESCENT_TIMEOUT:g} s of a landing"
        self._highest = height
        return self._debounce.advance(step, complaint)


class FlightWatch:
    """Watches position, climb, descent, publishers of controls, and the computer's load.

    ``is_tilted`` is whether the vehicle is tilted as only one that crashes is.
    """

    def __init__(self, limits: Limits):
        self.walls = Walls(limits)
        self.gaps = RunGaps()
        self.is_tilted = False
        self._position_complaint, self._position_age = "", math.inf
        self._position_debounce = Debounce(CRASH_DURATION)
        self.climb = ClimbLimit(limits.climb)
        self._descent = DescentWatch()
        # The server is silent in flight: another one at once is a second one.
        self._takeoff_callers = Callers("takeoff controls", 0)
        self._commanded_callers = Callers("commanded controls", HANDOVER)

    @property
    def is_nominal(self) -> bool:
        """Whether nothing has been measured that would stop the motors."""
        return not (self.is_tilted or self._position_complaint)

    @property
    def contention(self) -> str:
        """In words, that two nodes publish the same controls; empty if they do not."""
        return self._takeoff_callers.complaint or self._commanded_callers.complaint

    def measure(self, motion: Motion, age: float) -> None:
        """Take a state that was measured ``age`` s ago."""
        self._position_complaint = self.walls.complaint(motion.position)
        self._position_age = age

    def note_takeoff(self, time: float, caller: str, is_on_ground: bool) -> None:
        """Take the name of the node that has sent a takeoff control at ``time`` (s)."""
        self._takeoff_callers.note(time, caller, OVERLAP if is_on_ground else math.inf)

    def note_commanded(self, time: float, caller: str) -> None:
        """Take the name of the node that has sent a commanded control at ``time`` (s)."""
        self._commanded_callers.note(time, caller)

    def advance(self, time: float, step: float, height: float | None) -> tuple[str, str]:
        """Let time pass until ``time``, of which ``step`` counts, s; return crash and objection.

        They are in words why the motors are stopped in the air, and why the vehicle is landed; or
        empty. ``height`` (m) is that of a vehicle that its controller is to bring down; None of any
        other.
        """
        self.gaps.run(time)
        for callers in (self._takeoff_callers, self._commanded_callers):
            callers.advance(time)
        self._position_age += step
        is_fresh = self._position_age < MAX_FEEDBACK_AGE
        crash = self._position_debounce.advance(step, self._position_complaint if is_fresh else "")
        if self.is_tilted:
            crash = "the vehicle has tilted over"
        objection = self.climb.advance(step) or self.gaps.complaint
        return crash, self._descent.advance(step, height) or objection
