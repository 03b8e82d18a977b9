"""The last node before the vehicle: chooses between controls, and flies when none comes."""

import math
from dataclasses import replace
from typing import Generic, NamedTuple

from crazyflie_takeoff.control_filter import Control
from crazyflie_takeoff.filter_states import (
    LAST_STATE,
    RESET_DELAY,
    SHORTEST_HOLD,
    Event,
    FilterMachine,
    FilterState,
    LossTimeouts,
)
from crazyflie_takeoff.flight_state import FlightState
from crazyflie_takeoff.limits import Limits
from crazyflie_takeoff.relay import Relay
from crazyflie_takeoff.safe_control import (
    LONGEST_STEP,
    MAX_SUBSTITUTE,
    MOTORS_OFF,
    RETURN_TIME,
    SafeControl,
    Setpoint,
)
from crazyflie_utils.refusal import RefusalError


class Status(NamedTuple):
    """What the filter publishes about itself; see crazyflie_msgs/FilterStatus."""

    state: FilterState
    reason: str
    takeoff_refusal: str
    flight_state: FlightState | None
    is_commanded: bool


class SafeFilter(Generic[Control]):
    """Passes controls on within limits, or makes its own, as `FilterMachine` says.

    Methods that return something to publish return a control as it has come, or a `Setpoint` of the
    filter's own, or None. `tick` has to be called every 10 ms, or 40 ms while `is_nominal`.
    ``sees`` is whether states can be expected.
    """

    def __init__(self, timeouts: LossTimeouts, limits: Limits, sees: bool = False):
        timeouts = replace(timeouts, hold=max(timeouts.hold, SHORTEST_HOLD))
        self._hold = timeouts.hold
        self.relay: Relay[Control] = Relay(limits, self._hold)
        self.choice, self.watch = self.relay.choice, self.relay.watch
        self._measured = self.relay.measured
        self.machine = FilterMachine(timeouts, self.choice, self._measured, self.relay.ground)
        # The filter before this one was away for too long if the vehicle is on the ground:
        # until that is known, nothing is passed on in flight.
        self._ground_check_pending = sees
        self._ticked = math.nan
        self._safe = SafeControl(self.relay.hover, None)
        self._own = MOTORS_OFF
        # Since a control has come back, s; for `RETURN_TIME` the filter's own passes over to it.
        self._return_age = math.inf

    @property
    def state(self) -> FilterState:
        """What the filter does."""
        return self.machine.state

    @property
    def longest_gap(self) -> float:
        """The longest time in which the filter has lately not run, s."""
        return self.watch.gaps.longest

    @property
    def is_nominal(self) -> bool:
        """Whether nothing can happen within half the time for which the filter holds on."""
        machine = self.machine
        is_heard = machine.silence < 0.5 * self._hold or machine.is_on_ground
        is_settled = self.state is FilterState.PASSING and self._return_age >= RETURN_TIME
        return is_settled and is_heard and self.watch.is_nominal and not self._ground_check_pending

    @property
    def status(self) -> Status:
        """What the filter does, and why."""
        reason = "" if self.state is FilterState.PASSING else self.machine.reason
        choice = self.choice
        return Status(self.state, reason, self._refusal, choice.remembered, choice.is_commanded)

    @property
    def _refusal(self):
        stays = self.machine.is_on_ground and self.state is not FilterState.EMERGENCY
        return self.watch.contention if stays else ""

    def toggle(self) -> None:
        """Take a toggle of in_flight; none of them brings back a flight that has ended."""
        if not self.state.passes_nothing:
            self.choice.toggle()

    # Controls.

    def takeoff(
        self, time: float, control: Control, setpoint: Setpoint, caller: str = ""
    ) -> Control | Setpoint | None:
        """Return what to pass on when a takeoff control has come from a node at ``time`` (s).

        ``setpoint`` has the numbers of ``control``.
        """
        self.watch.gaps.run(time)
        self.watch.note_takeoff(time, caller, self.machine.is_on_ground)
        self._land_if_contended()
        if self._refusal and setpoint.thrust > 0.0:
            return MOTORS_OFF
        self.machine.may_lack_reference = False
        self.machine.takeoff_thrust = setpoint.thrust
        self.machine.handle(Event.TAKEOFF_CONTROL)
        if self.state is not FilterState.PASSING:
            return None
        self._ground_check_pending = False
        self._return_age = math.inf
        return self.relay.takeoff(time, control, setpoint)

    def commanded(
        self, time: float, control: Control, setpoint: Setpoint, caller: str = "", age: float = 0.0
    ) -> Control | Setpoint | None:
        """Return what to pass on when a commanded control has come; see `takeoff`.

        One that is made from data that were measured ``age`` s earlier than usual is as one that
        came so much earlier.
        """
        self.watch.gaps.run(time)
        self.watch.note_commanded(time, caller)
        # The next tick adds all of its step.
        self.machine.silence = min(self.machine.silence, age - self._step_until(time))
        self.machine.lacks_controller = self.machine.may_lack_reference = False
        chosen = self.relay.choose(time, control, setpoint)
        is_unchecked = self._ground_check_pending and self.choice.in_flight
        if is_unchecked and self._measured.fresh is not None:
            self._ground_check_pending = is_unchecked = False
            self.machine.handle(Event.FIRST_STATE)
        if self.state.passes_nothing or is_unchecked or chosen is None:
            return None
        if chosen is not control:
            return self.relay.repeated(chosen, time)
        return self._pass_on(time, control, age) if age < self._hold else None

    def _pass_on(self, time, control, age=0.0):
        if self.machine.handle(Event.COMMANDED_CONTROL):
            self._return_age = 0.0
        passed = self.relay.commanded(time, control, age, self.machine.is_on_ground)
        if self._return_age >= RETURN_TIME:
            return passed
        return self.relay.mixed(self._own, self._return_age / RETURN_TIME)

    def stop_listening(self, time: float) -> Control | Setpoint | None:
        """Return what to pass on; see `ControlFilter.stop_listening`."""
        self._ground_check_pending = False
        waiting = self.choice.stop_listening(time)
        return (
            None if waiting is None or self.state.passes_nothing else self._pass_on(time, waiting)
        )

    def tick(self, time: float) -> Setpoint | None:
        """Let time pass until ``time`` (s); return what to publish, or None."""
        machine = self.machine
        step = self._step_until(time)
        # Unlike a silence, a state is as old as it seems.
        elapsed = max(time - self._ticked, 0.0) if self._ticked < math.inf else 0.0
        self._measured.advance(elapsed)
        self._ticked = time
        machine.elapsed += step
        machine.silence += step
        self._return_age += step
        self._watch_flight(time, step)
        self.choice.advance(time)
        machine.is_needed = self.choice.selects_controller(time, self._hold)
        self._handle(Event.TICK)
        if self.state in (FilterState.HOLDING, FilterState.SINKING):
            return self._fly(elapsed)
        if self.state is not FilterState.PASSING:
            return MOTORS_OFF
        if self._return_age < RETURN_TIME and machine.is_needed and self.longest_gap > self._hold:
            # The control that has come back may stay the last one for a while.
            return self.relay.mixed(self._fly(elapsed), self._return_age / RETURN_TIME)
        return self.relay.late(time, machine.silence, machine.is_needed)

    def _watch_flight(self, time, step):
        height = self.relay.landing_height if self.state is FilterState.PASSING else None
        crash, objection = self.watch.advance(time, step, height)
        if crash:
            self.machine.handle(Event.CRASH, crash)
        if objection:
            self._handle(Event.OBJECTION, objection)
        self._land_if_contended()

    def _land_if_contended(self):
        if contention := self.watch.contention:
            self._handle(Event.OBJECTION, contention)

    def _handle(self, event, reason=""):
        had_control = self.state is FilterState.PASSING
        if self.machine.handle(event, reason) and had_control:
            # The state stops before the control does: the last one is what there is.
            motion, age = self._measured.within(LAST_STATE), self._measured.age
            self._safe = SafeControl(self.relay.hover, motion, age, self.relay.passed)
            self.relay.ground.begin_descent()

    def _fly(self, elapsed):
        # The step before it took over is reckoned then; after a longest one the clock was set.
        step = min(elapsed, LAST_STATE) if self.machine.elapsed > 0.0 else 0.0
        sinks = self.state is FilterState.SINKING
        own = self._safe.advance(step, self._measured.fresh, sinks)
        own = self.watch.gaps.apply(own, self.relay.hover, self._safe.climb)
        self._own = own._replace(thrust=min(own.thrust, MAX_SUBSTITUTE))
        thrust = self._own.thrust / self.relay.hover
        self.relay.ground.advance(step, self._measured.fresh, thrust)
        return self._own

    def _step_until(self, time):
        elapsed = time - self._ticked
        return min(max(elapsed, 0.0), LONGEST_STEP) if math.isfinite(elapsed) else 0.0

    # Emergencies.

    def stop(self, reason: str) -> None:
        """Stop the motors now and until `reset`, whatever comes."""
        self.machine.handle(Event.STOP, reason)

    def reset(self) -> None:
        """Let the next takeoff have the vehicle again.

        `RefusalError`: nothing has stopped the motors, or the vehicle may not be on the ground yet.
        """
        if self.state is not FilterState.EMERGENCY:
            raise RefusalError("there is no emergency")
        if not self.machine.handle(Event.RESET):
            raise RefusalError(
                f"the motors were stopped less than {RESET_DELAY:g} s ago; see that the vehicle "
                "is at rest on the ground"
            )
