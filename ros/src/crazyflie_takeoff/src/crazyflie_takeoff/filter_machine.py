"""The filter's states, and the machine that selects controls and flies when none comes."""

import enum
import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.limits import OVERLAP, Box, Limits
from crazyflie_takeoff.motion import Motion
from crazyflie_takeoff.relay import Relay
from crazyflie_takeoff.safe_control import (
    LONGEST_STEP,
    MAX_SUBSTITUTE,
    MOTORS_OFF,
    RETURN_TIME,
    SafeControl,
    SafeSetpoint,
    descent_time,
)
from crazyflie_takeoff.transition_table import FlightState, Table, Transition, step
from crazyflie_utils.refusal import RefusalError

TAKEOFF_CONTROL_LIMIT = 0.5  #: Age of a takeoff control up to which it excludes commanded ones (s).
#: Age up to which no control is late (s): three periods of a controller at 100 Hz.
SHORTEST_HOLD = 0.03
LAST_STATE = 0.7  #: Age of the oldest state from which the filter predicts the motion (s).
RESET_DELAY = 2.0  #: Time after an emergency in which a vehicle may still fall (s).

Control = TypeVar("Control")


class FilterState(enum.IntEnum):
    """State of the filter; the values are those of crazyflie_msgs/FilterStatus."""

    PASSING = 0  # Passes on controls.
    HOLDING = 1  # Keeps the vehicle in place until a control comes back.
    SINKING = 2  # Brings the vehicle down.
    DOWN = 3  # Keeps the motors off until the next takeoff.
    EMERGENCY = 4  # Keeps the motors off until a reset.

    @property
    def passes_nothing(self) -> bool:
        """Whether no control is passed on, not even one that comes back."""
        return self >= FilterState.SINKING


class FilterEvent(enum.Enum):
    """Event that can change the state of the filter."""

    TAKEOFF_CONTROL = enum.auto()  # A control of the takeoff server.
    COMMANDED_CONTROL = enum.auto()  # A control of the controller, while it is selected.
    FIRST_STATE = enum.auto()  # The first state of a filter that starts in flight.
    TICK = enum.auto()  # Time has passed.
    OBJECTION = enum.auto()  # Controls must not be passed on any more.
    CRASH = enum.auto()  # The vehicle is outside of its limits, or tilted over.
    VEHICLE_LOST = enum.auto()  # The vehicle has not been able to fly for a while.
    STOP = enum.auto()  # /emergency was called.
    RESET = enum.auto()  # /emergency_reset was called.


@dataclass(frozen=True)
class LossTimeouts:
    """Timeouts after a loss, s."""

    hold: float  # Time from the last control until the filter holds; at least `SHORTEST_HOLD`.
    recovery: float  # Then until the descent: without a state, and in a takeoff or a landing.
    descent: float  # Then until the motors stop; plus the duration of the descent if it is known.
    place: float  # The same as ``recovery`` for a vehicle in flight whose state is known.


class Status(NamedTuple):
    """Status that the filter publishes; see crazyflie_msgs/FilterStatus."""

    state: FilterState
    reason: str
    takeoff_refusal: str
    flight_state: FlightState | None
    is_commanded: bool


_PASSING, _HOLDING, _SINKING, _DOWN, _EMERGENCY = FilterState


class FilterMachine(Generic[Control]):
    """Passes controls on within limits, or makes its own; `TABLE` has its transitions.

    Takeoff controls are always selected. Commanded controls are selected in flight, and when the
    last takeoff control is older than `TAKEOFF_CONTROL_LIMIT`; otherwise the last takeoff control
    is repeated.

    Toggles decide whether the vehicle is in flight until a flight state is known. Then only the
    flight state does, so that a toggle and a state of the same event cannot cancel each other. On
    the ground, the flight state also excludes commanded controls if the server has died and does
    not repeat zero thrust: the controller may have a reference high above. A filter that has just
    started listens until a takeoff control comes or `stop_listening` is called; before that, only a
    flight state can select the controller.

    Methods that return a control to publish return it unchanged, or a `SafeSetpoint` of the
    filter's own, or None. Call `tick` every 10 ms, or 40 ms while `is_nominal`.
    ``sees`` states whether the vehicle's state is received.
    """

    def __init__(self, timeouts: LossTimeouts, limits: Limits, sees: bool = False):
        self._timeouts = replace(timeouts, hold=max(timeouts.hold, SHORTEST_HOLD))
        self.relay = Relay(limits, self._timeouts.hold)
        self._measured, self._ground = self.relay.measured, self.relay.ground
        self.state = FilterState.PASSING
        self.reason = ""  # Why the state is not PASSING.
        self.elapsed = 0.0  # Time since the state began (s).
        # Age of the last commanded control (s). It begins at 0, since a filter that starts in
        # flight is not connected at once.
        self.silence = 0.0
        self.is_needed = False  # Whether the vehicle would fall without the controller.
        # Whether a flight was ended because no control came, and none has come since.
        self.lacks_controller = False
        # Whether there was no takeoff server for a while since the last control. Without a
        # reference of the server, the controller is silent.
        self.may_lack_reference = False
        self.takeoff_thrust = 0.0  # Thrust of the latest takeoff control (m/s^2).
        self.takeovers = 0  # Number of times that the filter has held the vehicle.
        self.is_commanded = False  # Whether a commanded control has ever come.
        # Whether a control that is on time and in its ranges passes unchanged.
        self.passes_unchanged = False
        self._flight_state: FlightState | None = None
        self._toggled = False
        # Whether the vehicle is in flight, by the flight state or else by the toggles.
        self.in_flight = False
        self._is_listening = True
        self._waiting: Control | None = None  # A commanded control, while the filter listens.
        # The last takeoff control that was passed on, its thrust (m/s^2), and when it came (s).
        self._takeoff_control: Control | None = None
        self._kept_thrust = 0.0
        self._takeoff_time = math.inf
        # Pass nothing on until the first state is seen: a vehicle on the ground had no filter for
        # too long.
        self._ground_check_pending = sees
        self._ticked = math.nan
        self._safe = SafeControl(self.relay.hover, None)
        self._own = MOTORS_OFF
        self._return_age = math.inf  # Time since a control has come back (s); see `RETURN_TIME`.
        self._last_motion: Motion | None = None
        self._event_reason = self._cause = ""
        self._descent_limit = 0.0

    # Flight state.

    @property
    def flight_state(self) -> FlightState | None:
        """The last flight state of the server; None if it is not known."""
        return self._flight_state

    @flight_state.setter
    def flight_state(self, state: FlightState | None) -> None:
        self._flight_state = state
        self._update_in_flight()

    def toggle(self) -> None:
        """Process a toggle of in_flight; no toggle restores a flight that has ended."""
        if not self.state.passes_nothing:
            self._toggled = not self._toggled
            self._update_in_flight()

    def _update_in_flight(self):
        state = self._flight_state
        self.in_flight = self._toggled if state is None else state.in_flight
        self.passes_unchanged = False

    @property
    def remembered(self) -> FlightState | None:
        """The flight state for a server that has been restarted; None if unknown.

        A toggle to the ground is not remembered: if one toggle was missed, it means flight.
        """
        if self._flight_state is None and self._toggled:
            return FlightState.FLYING
        return self._flight_state

    @property
    def server_reports_ground(self) -> bool:
        """Whether the server sends zero thrust to a vehicle on the ground."""
        sends_zero = self._takeoff_control is not None and self._kept_thrust <= 0.0
        is_there = self._flight_state in (None, FlightState.ON_GROUND)
        return sends_zero and not self.in_flight and is_there

    @property
    def is_on_ground(self) -> bool:
        """Whether nothing shows that the vehicle is off the ground, or its motors are off."""
        is_off = self.state in (FilterState.DOWN, FilterState.EMERGENCY)
        return is_off or (self.state is FilterState.PASSING and self._stands)

    @property
    def _stands(self):
        if self.in_flight or self._kept_thrust > 0.0:
            return False
        # At the end of a landing, zero thrust means that the vehicle is on the ground.
        return self._flight_state is not FlightState.TAKING_OFF

    @property
    def _lands(self):
        return self._flight_state is FlightState.DESCENDING

    def takeoff_age(self, time: float) -> float:
        """Return the age of the last takeoff control at ``time``, s; infinite without one."""
        return math.inf if self._takeoff_control is None else time - self._takeoff_time

    def selects_controller(self, time: float) -> bool:
        """Return whether the vehicle would fall at ``time`` (s) without the controller.

        That is the case in flight, unless a takeoff control has just come. It is also the case
        between takeoff and flight, and if the server has died above the ground, once the last
        takeoff control is older than `TAKEOFF_CONTROL_LIMIT`.
        """
        if self.in_flight:
            return self.takeoff_age(time) > self._timeouts.hold
        return not self._stands and self.takeoff_age(time) > TAKEOFF_CONTROL_LIMIT

    # Status.

    @property
    def is_nominal(self) -> bool:
        """Whether no transition is possible within half of the timeout ``hold``."""
        latest = 0.5 * self._timeouts.hold
        lifts_off = not self.is_needed and self.takeoff_age(self._ticked) < latest
        is_heard = self.silence < latest or lifts_off or self.is_on_ground
        is_settled = self.state is FilterState.PASSING and self._return_age >= RETURN_TIME
        return is_settled and is_heard and self.relay.is_nominal and not self._ground_check_pending

    @property
    def status(self) -> Status:
        """The state, its reason, and what the filter knows of the flight."""
        reason = "" if self.state is FilterState.PASSING else self.reason
        return Status(self.state, reason, self._refusal, self.remembered, self.is_commanded)

    @property
    def _refusal(self):
        contention = self.relay.contention
        stays = contention and self.is_on_ground and self.state is not FilterState.EMERGENCY
        return contention if stays else ""

    # Inputs.

    def measure(self, motion: Motion, age: float = 0.0) -> None:
        """Process a state that was measured ``age`` s ago."""
        relay = self.relay
        relay.flush()
        relay.measure(motion, age, self.server_reports_ground, self.in_flight)
        self.passes_unchanged = self.passes_unchanged and relay.is_free

    def set_tilted(self, is_tilted: bool) -> None:
        """Record whether the vehicle has tilted over."""
        self.relay.is_tilted = is_tilted
        self.passes_unchanged = False

    def set_box(self, box: Box) -> None:
        """Set the box of the geofence."""
        self.relay.walls.change(box.without_floor())
        self.passes_unchanged = False

    def miss_controller(self) -> None:
        """No node publishes controls; treat the next one as new."""
        self.lacks_controller = False

    def miss_server(self) -> None:
        """Record that no node publishes takeoff controls."""
        self.may_lack_reference = True
        self.passes_unchanged = False

    # Controls.

    def takeoff(
        self, time: float, control: Control, setpoint: SafeSetpoint, caller: str = ""
    ) -> Control | SafeSetpoint | None:
        """Return the control to publish after a takeoff control of a node at ``time`` (s).

        ``setpoint`` has the numbers of ``control``.
        """
        relay = self._interrupt(time)
        overlap = OVERLAP if self.is_on_ground else math.inf
        relay.takeoff_callers.note(time, caller, overlap)
        self._land_if_contended()
        if self._refusal and setpoint.thrust > 0.0:
            return MOTORS_OFF
        self.may_lack_reference = False
        self.takeoff_thrust = setpoint.thrust
        self.handle(FilterEvent.TAKEOFF_CONTROL)
        if self.state is not FilterState.PASSING:
            return None
        self._ground_check_pending = False
        self._return_age = math.inf
        self._is_listening, self._waiting = False, None
        self._takeoff_control, self._takeoff_time = control, time
        self._kept_thrust = setpoint.thrust
        return relay.takeoff(control, setpoint, self._lands)

    def pass_unchanged(self, time: float, control: Any, age: float) -> bool:
        """Accept a commanded control if it passes unchanged; return whether it does.

        In a nominal flight nearly all controls do; for the others, call `commanded`. The control
        comes from the node that sent the last one, and has the fields of a `SafeSetpoint`; for
        ``age`` see `commanded`.
        """
        elapsed = time - self._ticked
        is_nominal = self.passes_unchanged and age < 0.5 * self._timeouts.hold
        if not (is_nominal and 0.0 <= elapsed <= LONGEST_STEP):
            return False
        if not self.relay.pass_unchanged(time, control):
            return False
        self.silence = min(self.silence, age - elapsed)
        return True

    def commanded(
        self,
        time: float,
        control: Control,
        setpoint: SafeSetpoint,
        caller: str = "",
        age: float = 0.0,
    ) -> Control | SafeSetpoint | None:
        """Return the control to publish after a commanded control; see `takeoff`.

        A control whose data were measured ``age`` s earlier than usual is treated as if it had come
        that much earlier.
        """
        relay = self._interrupt(time)
        relay.commanded_callers.note(time, caller)
        # The next tick adds its whole step.
        self.silence = min(self.silence, age - self._step_until(time))
        self.lacks_controller = self.may_lack_reference = False
        relay.command(setpoint)
        chosen = self._choose(time, control)
        is_unchecked = self._ground_check_pending and self.in_flight
        if is_unchecked and self._measured.fresh is not None:
            self._ground_check_pending = is_unchecked = False
            self.handle(FilterEvent.FIRST_STATE)
        if self.state.passes_nothing or is_unchecked or chosen is None:
            return None
        if chosen is not control:
            return relay.late_takeoff(self.takeoff_age(time)) or chosen
        return self._pass_on(time, control, age) if age < self._timeouts.hold else None

    def _choose(self, time, control):
        """Return the control that is selected after a commanded one, or None."""
        self._takeoff_time = min(self._takeoff_time, time)
        self.is_commanded = True
        self._waiting = None
        if self.in_flight:
            return control
        if self._takeoff_control is None and self._is_listening:
            self._waiting = control
            return None
        # Thrust above zero comes from a server that takes off without a flight state; the known
        # flight state is outdated then.
        is_kept_down = self._flight_state is FlightState.ON_GROUND and self._kept_thrust <= 0.0
        if is_kept_down or self.takeoff_age(time) <= TAKEOFF_CONTROL_LIMIT:
            return self._takeoff_control
        return control

    def _pass_on(self, time, control, age=0.0):
        if self.handle(FilterEvent.COMMANDED_CONTROL):
            self._return_age = 0.0
        learns = not self.is_on_ground
        passed = self.relay.commanded(time, control, age, self.in_flight, self._lands, learns)
        if self._return_age >= RETURN_TIME:
            return passed
        return self.relay.mixed(self._own, self._return_age / RETURN_TIME)

    def stop_listening(self, time: float) -> Control | SafeSetpoint | None:
        """Return the commanded control that has waited until ``time`` (s), or None."""
        self._ground_check_pending = self._is_listening = False
        if self._waiting is None:
            return None
        chosen = self._choose(time, self._waiting)
        return None if chosen is None or self.state.passes_nothing else self._pass_on(time, chosen)

    def tick(self, time: float) -> SafeSetpoint | None:
        """Advance to ``time`` (s); return a control to publish, or None."""
        relay = self.relay
        relay.flush()
        step = self._step_until(time)
        # In contrast to a silence, a state ages by the whole time.
        elapsed = max(time - self._ticked, 0.0) if self._ticked < math.inf else 0.0
        self._ticked = time
        self.elapsed += step
        self.silence += step
        self._return_age += step
        relay.advance(time, elapsed)
        if self.passes_unchanged and step > 0.0 and self.is_needed and relay.is_free:
            # Only the silence can change anything now.
            if self.silence < 0.5 * self._timeouts.hold:
                return None
        lands = self._lands and self.state is FilterState.PASSING
        crash, objection = relay.complaints(step, lands)
        if crash:
            self.handle(FilterEvent.CRASH, crash)
        if objection:
            self.handle(FilterEvent.OBJECTION, objection)
        self._land_if_contended()
        self._takeoff_time = min(self._takeoff_time, time)
        self.is_needed = self.selects_controller(time)
        self.handle(FilterEvent.TICK)
        is_missed = self.lacks_controller or self.may_lack_reference or not self.is_commanded
        # In the climb of a takeoff, the controller is selected when the server has become silent.
        climbs = self._flight_state is FlightState.TAKING_OFF and self.is_needed
        is_flying = self._flight_state is FlightState.FLYING or climbs
        is_selected = is_flying and not is_missed
        self.passes_unchanged = is_selected and relay.is_free and self.is_nominal
        return self._substitute(time, elapsed)

    def _substitute(self, time, elapsed):
        """Return a control of the filter's own, or None."""
        if self.state in (FilterState.HOLDING, FilterState.SINKING):
            return self._fly(elapsed)
        if self.state is not FilterState.PASSING:
            return MOTORS_OFF
        is_busy = self.relay.gaps.longest > self._timeouts.hold
        if self._return_age < RETURN_TIME and self.is_needed and is_busy:
            # A filter that seldom runs cannot rely on the next control to complete the change.
            return self.relay.mixed(self._fly(elapsed), self._return_age / RETURN_TIME)
        if self.is_needed:
            return self.relay.late(self.silence)
        age = self.takeoff_age(time)
        keeps_up = age <= TAKEOFF_CONTROL_LIMIT and not self._stands and not self.in_flight
        return self.relay.late_takeoff(age) if keeps_up else None

    def _interrupt(self, time):
        """End the passing of unchanged controls, and return the relay."""
        self.passes_unchanged = False
        self.relay.flush()
        self.relay.gaps.run(time)
        return self.relay

    def _land_if_contended(self):
        if contention := self.relay.contention:
            self.handle(FilterEvent.OBJECTION, contention)

    def _fly(self, elapsed):
        # `SafeControl` has integrated the step before the takeover.
        step = min(elapsed, LAST_STATE) if self.elapsed > 0.0 else 0.0
        relay, motion = self.relay, self._measured.fresh
        own = self._safe.advance(step, motion, self.state is FilterState.SINKING)
        own = relay.gaps.apply(own, relay.hover, self._safe.climb)
        self._own = own._replace(thrust=min(own.thrust, MAX_SUBSTITUTE))
        self._ground.advance(step, motion, self._own.thrust / relay.hover)
        return self._own

    def _step_until(self, time):
        elapsed = time - self._ticked
        return min(max(elapsed, 0.0), LONGEST_STEP) if math.isfinite(elapsed) else 0.0

    # Ends of a flight.

    def lose_vehicle(self, reason: str) -> None:
        """Stop the motors of a vehicle that cannot fly, until the next takeoff."""
        self.handle(FilterEvent.VEHICLE_LOST, reason)

    def stop(self, reason: str) -> None:
        """Stop the motors until `reset`, whatever controls come."""
        self.handle(FilterEvent.STOP, reason)

    def reset(self) -> None:
        """Allow the next takeoff after an emergency.

        `RefusalError`: there is no emergency, or the vehicle may not be on the ground yet.
        """
        if self.state is not FilterState.EMERGENCY:
            raise RefusalError("there is no emergency")
        if not self.handle(FilterEvent.RESET):
            raise RefusalError(
                f"the motors were stopped less than {RESET_DELAY:g} s ago; see that the vehicle "
                "is at rest on the ground"
            )

    # The table.

    def handle(self, event: FilterEvent, reason: str = "") -> bool:
        """Step the table; return whether the state has changed.

        ``reason`` is that of an objection, a crash, a lost vehicle or a stop.
        """
        self._event_reason = reason
        before, self.state = self.state, step(self.TABLE, self.state, event, self)
        if self.state is before:
            return False
        self.elapsed = 0.0
        self.passes_unchanged = False
        if before is FilterState.PASSING:
            # States stop before controls do, so the last state is used.
            relay, motion = self.relay, self._measured.within(LAST_STATE)
            self._safe = SafeControl(
                relay.hover, motion, self._measured.age, relay.passed, relay.blind_hover
            )
            self._ground.begin_descent()
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
        is_flying = self.remembered is FlightState.FLYING
        longest = self._timeouts.place if is_flying else self._timeouts.recovery
        blind = min(self.elapsed, self._measured.age)
        is_over = self.elapsed > longest or blind > self._timeouts.recovery
        return self.is_needed and is_over

    def _has_touched_down(self):
        return self._ground.has_touched_down(self._measured.fresh)

    def _descent_is_over(self):
        is_long = self.elapsed > self._descent_limit
        return is_long and not self._ground.sinks(self._measured.fresh)

    def _may_be_reset(self):
        return self.elapsed >= RESET_DELAY

    # Actions.

    def _end_flight(self):
        self._toggled = False
        self._kept_thrust = 0.0
        self._update_in_flight()

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
        # If the motors stop too early, the vehicle falls; too late does no harm.
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
        self._end_flight()

    #: The transitions; in any other case the state stays.
    TABLE: ClassVar[Table[FilterState, "FilterMachine[Any]"]] = (
        Transition(_PASSING, FilterEvent.FIRST_STATE, _seen_on_ground, _DOWN, _stay_on_ground),
        Transition(_PASSING, FilterEvent.TICK, _control_is_lost, _HOLDING, _hold_place),
        Transition(_PASSING, FilterEvent.OBJECTION, _is_airborne, _SINKING, _take_over_and_land),
        Transition(_PASSING, FilterEvent.CRASH, _is_airborne, _EMERGENCY, _stop_at_once),
        Transition(_PASSING, FilterEvent.VEHICLE_LOST, _is_airborne, _DOWN, _stop_at_once),
        Transition(_PASSING, FilterEvent.STOP, None, _EMERGENCY, _stop_at_once),
        Transition(_HOLDING, FilterEvent.FIRST_STATE, _seen_on_ground, _DOWN, _stay_on_ground),
        Transition(_HOLDING, FilterEvent.COMMANDED_CONTROL, None, _PASSING),
        Transition(_HOLDING, FilterEvent.TAKEOFF_CONTROL, None, _PASSING),
        Transition(_HOLDING, FilterEvent.TICK, _control_is_not_needed, _PASSING),
        Transition(_HOLDING, FilterEvent.TICK, _control_stays_away, _SINKING, _give_up_waiting),
        Transition(_HOLDING, FilterEvent.OBJECTION, None, _SINKING, _land),
        Transition(_HOLDING, FilterEvent.CRASH, None, _EMERGENCY, _stop_at_once),
        Transition(_HOLDING, FilterEvent.VEHICLE_LOST, None, _DOWN, _stop_at_once),
        Transition(_HOLDING, FilterEvent.STOP, None, _EMERGENCY, _stop_at_once),
        Transition(_SINKING, FilterEvent.TICK, _has_touched_down, _DOWN, _end_descent),
        Transition(_SINKING, FilterEvent.TICK, _descent_is_over, _DOWN, _end_long_descent),
        Transition(_SINKING, FilterEvent.CRASH, None, _EMERGENCY, _stop_at_once),
        Transition(_SINKING, FilterEvent.VEHICLE_LOST, None, _DOWN, _stop_at_once),
        Transition(_SINKING, FilterEvent.STOP, None, _EMERGENCY, _stop_at_once),
        Transition(_DOWN, FilterEvent.TAKEOFF_CONTROL, _lifts_off, _PASSING, _end_flight),
        Transition(_DOWN, FilterEvent.STOP, None, _EMERGENCY, _stop_at_once),
        Transition(_EMERGENCY, FilterEvent.RESET, _may_be_reset, _DOWN, _release),
    )
