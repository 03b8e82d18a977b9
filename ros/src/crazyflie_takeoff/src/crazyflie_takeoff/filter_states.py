"""States of the control filter, and the table of their transitions."""

import enum
from dataclasses import dataclass
from typing import Any, ClassVar

from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.control_filter import ControlFilter
from crazyflie_takeoff.flight_state import FlightState
from crazyflie_takeoff.ground import Ground, is_sinking
from crazyflie_takeoff.motion import Measurement, Motion
from crazyflie_takeoff.safe_control import descent_time
from crazyflie_takeoff.transition_table import Table, Transition, step

#: A control younger than this, s, is never late: three periods of a controller at 100 Hz.
SHORTEST_HOLD = 0.03
LAST_STATE = 0.7  #: The oldest state from which the filter reckons how the vehicle moves, s.
#: How long after the motors were stopped they cannot be released, s: the vehicle may still fall.
RESET_DELAY = 2.0


class FilterState(enum.IntEnum):
    """What the filter does; the values are those of crazyflie_msgs/FilterStatus."""

    PASSING = 0  # Passes controls on.
    HOLDING = 1  # Keeps the vehicle in place until a control comes back.
    SINKING = 2  # Brings the vehicle down.
    DOWN = 3  # Keeps the motors off until the next takeoff.
    EMERGENCY = 4  # Keeps the motors off until a reset.

    @property
    def passes_nothing(self) -> bool:
        """Whether a control that comes back is not passed on, either."""
        return self >= FilterState.SINKING


class Event(enum.Enum):
    """What can change the state of the filter."""

    TAKEOFF_CONTROL = enum.auto()  # From the takeoff server.
    COMMANDED_CONTROL = enum.auto()  # From the controller, whose turn it is.
    FIRST_STATE = enum.auto()  # The first state of a filter that starts in flight.
    TICK = enum.auto()  # Time has passed.
    OBJECTION = enum.auto()  # Controls must not be passed on any more.
    CRASH = enum.auto()  # The vehicle is where or as it must not be.
    STOP = enum.auto()  # /emergency was called.
    RESET = enum.auto()  # /emergency_reset was called.


@dataclass(frozen=True)
class LossTimeouts:
    """How long the filter waits after a loss, s."""

    hold: float  # For a control in flight, until it holds the vehicle; at least `SHORTEST_HOLD`.
    recovery: float  # Then until the descent: without a state, and in a takeoff or a landing.
    descent: float  # Then until the motors stop; longer by the way down from the known height.
    place: float  # The same as ``recovery`` for a vehicle in flight whose state is known.


_PASSING, _HOLDING, _SINKING, _DOWN, _EMERGENCY = FilterState


class FilterMachine:
    """State of the filter, with the facts on which its transitions depend."""

    def __init__(
        self,
        timeouts: LossTimeouts,
        choice: ControlFilter[Any],
        measured: Measurement,
        ground: Ground,
    ):
        self._timeouts = timeouts
        self._choice, self._measured, self._ground = choice, measured, ground
        self.state = FilterState.PASSING
        self.reason = ""  # Why the state is not PASSING.
        self.elapsed = 0.0  # Since the state began, s.
        # Age of the last commanded control, s. As if one had just come: a filter that starts in
        # flight is not connected at once.
        self.silence = 0.0
        self.is_needed = False  # Whether the vehicle would fall without the controller.
        # Whether a flight was ended because no control came, and none has come since.
        self.lacks_controller = False
        # Whether there was no takeoff server for a while since the last control. If it has sent no
        # reference, the controller is silent.
        self.may_lack_reference = False
        self.takeoff_thrust = 0.0  # Of the takeoff control that has just come, m/s^2.
        self.takeovers = 0  # How often the filter has held the vehicle.
        self._last_motion: Motion | None = None
        self._event_reason = self._cause = ""
        self._descent_limit = 0.0

    @property
    def is_on_ground(self) -> bool:
        """Whether the vehicle is on the ground, or its motors are off."""
        is_off = self.state in (FilterState.DOWN, FilterState.EMERGENCY)
        return is_off or (self.state is FilterState.PASSING and self._choice.is_on_ground)

    def handle(self, event: Event, reason: str = "") -> bool:
        """Step the table; return whether the state has changed.

        An objection, a crash and a stop have a reason in words.
        """
        self._event_reason = reason
        before, self.state = self.state, step(self.TABLE, self.state, event, self)
        if self.state is before:
            return False
        self.elapsed = 0.0
        return True

    # Guards.

    def _is_airborne(self):
        return not self.is_on_ground

    def _lifts_off(self):
        return self.takeoff_thrust > GRAVITY

    def _seen_on_ground(self):
        return self._ground.is_below(self._measured.fresh)

    def _control_is_lost(self):
        return self.is_needed and self.silence > self._timeouts.hold

    def _control_is_not_needed(self):
        return not self.is_needed

    def _control_stays_away(self):
        is_flying = self._choice.remembered is FlightState.FLYING
        longest = self._timeouts.place if is_flying else self._timeouts.recovery
        blind = min(self.elapsed, self._measured.age)
        is_over = self.elapsed > longest or blind > self._timeouts.recovery
        return self.is_needed and is_over

    def _has_touched_down(self):
        return self._ground.has_touched_down(self._measured.fresh)

    def _descent_is_over(self):
        motion = self._measured.fresh
        return self.elapsed > self._descent_limit and (motion is None or not is_sinking(motion))

    def _may_be_reset(self):
        return self.elapsed >= RESET_DELAY

    # Actions.

    def _end_flight(self):
        self._choice.end_flight()

    def _hold_place(self):
        self.takeovers += 1
        self._last_motion = self._measured.within(LAST_STATE)
        self.reason = "no control comes, the filter keeps the vehicle in place"

    def _give_up_waiting(self):
        self.lacks_controller = not self.may_lack_reference
        waited = self._timeouts.hold + self.elapsed
        self._descend("no control came", f"no control came for {waited:.1f} s")

    def _take_over_and_land(self):
        self._last_motion = self._measured.within(LAST_STATE)
        self._land()

    def _land(self):
        self._descend(self._event_reason, f"{self._event_reason}; the filter lands")

    def _descend(self, cause, reason):
        self._cause, self.reason = cause, reason
        self._descent_limit = self._timeouts.descent
        # Too late the motors stop on the ground, too early the vehicle falls.
        if (motion := self._measured.fresh or self._last_motion) is not None:
            self._descent_limit += descent_time(motion, self._ground.z)

    def _end_descent(self):
        self._stop_motors(f"brought down by the filter because {self._cause}")

    def _end_long_descent(self):
        limit = self._descent_limit
        self._stop_motors(f"motors stopped after {limit:.1f} s of descent: {self._cause}")

    def _stay_on_ground(self):
        self._stop_motors("the vehicle was on the ground when the filter began")

    def _stop_at_once(self):
        self._stop_motors(self._event_reason)

    def _release(self):
        self.reason = "reset after an emergency"

    def _stop_motors(self, reason):
        self.reason = reason
        self._choice.end_flight()

    #: The transitions; in any other case the state stays.
    TABLE: ClassVar[Table[FilterState, "FilterMachine"]] = (
        Transition(_PASSING, Event.FIRST_STATE, _seen_on_ground, _DOWN, _stay_on_ground),
        Transition(_PASSING, Event.TICK, _control_is_lost, _HOLDING, _hold_place),
        Transition(_PASSING, Event.OBJECTION, _is_airborne, _SINKING, _take_over_and_land),
        Transition(_PASSING, Event.CRASH, _is_airborne, _EMERGENCY, _stop_at_once),
        Transition(_PASSING, Event.STOP, None, _EMERGENCY, _stop_at_once),
        Transition(_HOLDING, Event.FIRST_STATE, _seen_on_ground, _DOWN, _stay_on_ground),
        Transition(_HOLDING, Event.COMMANDED_CONTROL, None, _PASSING),
        Transition(_HOLDING, Event.TAKEOFF_CONTROL, None, _PASSING),
        Transition(_HOLDING, Event.TICK, _control_is_not_needed, _PASSING),
        Transition(_HOLDING, Event.TICK, _control_stays_away, _SINKING, _give_up_waiting),
        Transition(_HOLDING, Event.OBJECTION, None, _SINKING, _land),
        Transition(_HOLDING, Event.CRASH, None, _EMERGENCY, _stop_at_once),
        Transition(_HOLDING, Event.STOP, None, _EMERGENCY, _stop_at_once),
        Transition(_SINKING, Event.TICK, _has_touched_down, _DOWN, _end_descent),
        Transition(_SINKING, Event.TICK, _descent_is_over, _DOWN, _end_long_descent),
        Transition(_SINKING, Event.CRASH, None, _EMERGENCY, _stop_at_once),
        Transition(_SINKING, Event.STOP, None, _EMERGENCY, _stop_at_once),
        Transition(_DOWN, Event.TAKEOFF_CONTROL, _lifts_off, _PASSING, _end_flight),
        Transition(_DOWN, Event.STOP, None, _EMERGENCY, _stop_at_once),
        Transition(_EMERGENCY, Event.RESET, _may_be_reset, _DOWN, _release),
    )
