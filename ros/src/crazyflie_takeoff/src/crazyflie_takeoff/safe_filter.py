"""The control filter with what makes it safe: it is the last one before the vehicle."""

import math
from typing import Generic

from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.control_filter import Control
from crazyflie_takeoff.filter_mode import SHORTEST_HOLD, Mode, Patience
from crazyflie_takeoff.flight_state import SEPARATOR, FlightState, Takeover
from crazyflie_takeoff.limits import Box, Limits
from crazyflie_takeoff.motion import Motion
from crazyflie_takeoff.relay import Relay
from crazyflie_takeoff.safe_control import (
    LONGEST_STEP,
    MOTORS_OFF,
    RETURN_TIME,
    SafeControl,
    Setpoint,
    descent_time,
)
from crazyflie_takeoff.server_table import TOUCHDOWN_HEIGHT
from crazyflie_utils.refusal import RefusalError

LAST_STATE = 0.7
"""A state that is older, s, does not tell how the vehicle moves when the filter takes over."""

STANDING_SPEED = 0.1
"""A vehicle near the ground that sinks slower than this has met it, m/s."""

LYING_HEIGHT = 0.1
"""A vehicle below this when the filter starts has come down without it, m."""

RESET_DELAY = 2.0
"""How long after the motors were stopped they cannot be released, s: the vehicle may still fall."""

_TAKEOVERS = {
    Mode.SINKING: Takeover.SINKING,
    Mode.DOWN: Takeover.DOWN,
    Mode.EMERGENCY: Takeover.EMERGENCY,
}


class SafeFilter(Generic[Control]):
    """Choose between controls, and fly when none comes.

    Methods that return something to publish return a control as it has come, or a `Setpoint` of the
    filter's own, or None. It lives by calls of `tick`.

    Parameters
    ----------
    patience : Patience
    limits : Limits
    sees : bool
        Whether states can be expected.
    """

    def __init__(self, patience: Patience, limits: Limits, sees: bool = False):
        self.mode = Mode.PASSING
        self.takeovers = 0
        self._has_to_look = sees
        self._patience = patience
        self._hold = max(patience.hold, SHORTEST_HOLD)
        self._relay: Relay[Control] = Relay(limits, self._hold)
        self._choice, self._watch = self._relay.choice, self._relay.watch
        self._measured = self._relay.measured
        self._reason = ""
        self._ticked = math.nan
        self._in_mode = 0.0
        # As if one had just come: a filter that starts in flight is not connected at once.
        self._silence = 0.0
        self._lacks_control = False
        self._safe = SafeControl(self._relay.hover, None)
        self._descent_limit = 0.0
        self._cause = ""
        self._own = MOTORS_OFF
        self._return_age = math.inf

    # What it says.

    @property
    def hover_thrust(self) -> float:
        """What it has learned about the vehicle, m/s^2."""
        return self._relay.hover

    @property
    def control_age(self) -> float:
        """How long no commanded control has come, s."""
        return max(self._silence, 0.0)

    @property
    def longest_gap(self) -> float:
        """The longest time in which it has lately not run, s."""
        return self._watch.gaps.longest

    @property
    def lacks_control(self) -> bool:
        """Whether the controller was lost and has not been heard since."""
        return self._lacks_control

    @property
    def is_commanded(self) -> bool:
        """Whether a commanded control has ever come."""
        return self._choice.is_commanded

    @property
    def remembered(self) -> FlightState | None:
        """See `ControlFilter.remembered`."""
        return self._choice.remembered

    @property
    def takeover(self) -> Takeover | None:
        """What the server has to know; None while controls are passed on, or will be again."""
        return Takeover.REFUSING if self._refusal else _TAKEOVERS.get(self.mode)

    @property
    def is_calm(self) -> bool:
        """Whether nothing can happen within half the time for which it holds on."""
        is_heard = self._silence < 0.5 * self._hold or self._is_on_ground
        is_settled = self.mode is Mode.PASSING and self._return_age >= RETURN_TIME
        return is_settled and is_heard and self._watch.is_calm and not self._has_to_look

    @property
    def explanation(self) -> str:
        """Why it is so, to be published behind a word; empty if all is well."""
        reason = self._refusal or ("" if self.mode is Mode.PASSING else self._reason)
        return SEPARATOR + reason if reason else ""

    @property
    def _refusal(self):
        """Why the vehicle must not take off; empty in flight."""
        stays = self.mode is Mode.DOWN or (self.mode is Mode.PASSING and self._is_on_ground)
        return self._watch.contention if stays else ""

    # What it is told.

    def toggle(self) -> None:
        """Take note of a toggle of in_flight; none of them brings back a flight that has ended."""
        if not self.mode.is_final:
            self._choice.toggle()

    def set_state(self, state: FlightState) -> None:
        """Take note of the server's flight state."""
        self._choice.set_state(state)

    def set_box(self, box: Box) -> None:
        """Take another box of the geofence."""
        self._watch.walls.change(box)

    def measure(self, motion: Motion, age: float = 0.0) -> None:
        """Take a state that was measured ``age`` s ago."""
        self._relay.measure(motion, age)

    def set_tilted(self, is_tilted: bool) -> None:
        """Take note of whether the vehicle is tilted as only one that crashes is."""
        self._watch.is_tilted = is_tilted

    def controller_left(self) -> None:
        """Take note that nobody publishes commanded controls: whoever comes next is new."""
        self._lacks_control = False

    # Controls.

    def takeoff(
        self, time: float, control: Control, setpoint: Setpoint, caller: str = ""
    ) -> Control | Setpoint | None:
        """Return what to pass on when a takeoff control has come.

        Parameters
        ----------
        time : float
            Now, s.
        control : object
        setpoint : Setpoint
            Its numbers.
        caller : str
            Name of the node that sent it.
        """
        self._watch.gaps.run(time)
        self._watch.hear_takeoff(time, caller, self._is_on_ground)
        self._land_if_contended()
        if self.mode in (Mode.SINKING, Mode.EMERGENCY):
            return None
        if self._refusal and setpoint.thrust > 0.0:
            return MOTORS_OFF
        if self.mode is Mode.DOWN:
            # That of a landing lifts nothing.
            if setpoint.thrust <= GRAVITY:
                return None
            self._choice.end_flight()
        self._enter(Mode.PASSING, "")
        self._has_to_look = False
        self._return_age = math.inf
        return self._relay.takeoff(time, control, setpoint)

    def commanded(
        self,
        time: float,
        control: Control,
        setpoint: Setpoint,
        caller: str = "",
        age: float = 0.0,
    ) -> Control | Setpoint | None:
        """Return what to pass on when a commanded control has come; see `takeoff`.

        One that is made from data that were measured ``age`` s earlier than usual is as one that
        came so much earlier.
        """
        self._watch.gaps.run(time)
        self._watch.hear_commanded(time, caller)
        # The next tick adds all of its step.
        self._silence = min(self._silence, age - self._step_until(time))
        self._lacks_control = False
        chosen = self._relay.choose(time, control, setpoint)
        if self._has_to_look and self._choice.in_flight:
            self._look()
        if self.mode.is_final or (self._has_to_look and self._choice.in_flight) or chosen is None:
            return None
        if chosen is not control:
            return self._relay.repeated(chosen, time)
        return self._pass_on(time, control, age) if age < self._hold else None

    def _pass_on(self, time, control, age=0.0):
        if self.mode is Mode.HOLDING:
            self._enter(Mode.PASSING, "")
            self._return_age = 0.0
        passed = self._relay.commanded(time, control, age, self._is_on_ground)
        if self._return_age >= RETURN_TIME:
            return passed
        return self._relay.mixed(self._own, self._return_age / RETURN_TIME)

    def stop_listening(self, time: float) -> Control | Setpoint | None:
        """Return what to pass on; see `ControlFilter.stop_listening`."""
        self._has_to_look = False
        waiting = self._choice.stop_listening(time)
        return None if waiting is None or self.mode.is_final else self._pass_on(time, waiting)

    def tick(self, time: float) -> Setpoint | None:
        """Let time pass until ``time`` (s); return what to publish, or None."""
        step = self._step_until(time)
        # Unlike a silence, a state is as old as it seems.
        elapsed = max(time - self._ticked, 0.0) if self._ticked < math.inf else 0.0
        self._measured.advance(elapsed)
        self._ticked = time
        self._in_mode += step
        self._silence += step
        self._return_age += step
        self._look_after_flight(time, step)
        is_needed = self._choice.is_controllers(time, self._hold)
        if self.mode is Mode.PASSING and is_needed and self._silence > self._hold:
            self.takeovers += 1
            self._take_over(Mode.HOLDING, "no control comes, the filter keeps the vehicle in place")
        elif self.mode is Mode.HOLDING and not is_needed:
            self._enter(Mode.PASSING, "")
        elif self.mode is Mode.HOLDING and self._has_waited():
            self._lacks_control = True
            waited = self._hold + self._in_mode
            self._sink("no control came", f"no control came for {waited:.1f} s")
        elif self.mode is Mode.SINKING and (reason := self._end_of_descent()):
            self._stop_motors(Mode.DOWN, reason)
        if self.mode in (Mode.HOLDING, Mode.SINKING):
            return self._fly(elapsed)
        if self.mode is Mode.PASSING:
            if self._return_age < RETURN_TIME and is_needed and self.longest_gap > self._hold:
                # The control that has come back may stay the last one for a while.
                return self._relay.mixed(self._fly(elapsed), self._return_age / RETURN_TIME)
            return self._relay.late(time, self._silence, is_needed)
        return MOTORS_OFF

    def _fly(self, elapsed):
        # The step before it took over is reckoned then; after a longest one the clock was set.
        step = min(elapsed, LAST_STATE) if self._in_mode > 0.0 else 0.0
        own = self._safe.advance(step, self._measured.fresh, self.mode is Mode.SINKING)
        self._own = self._watch.gaps.apply(own, self._relay.hover, self._safe.climb)
        return self._own

    def _step_until(self, time):
        elapsed = time - self._ticked
        return min(max(elapsed, 0.0), LONGEST_STEP) if math.isfinite(elapsed) else 0.0

    def _look(self):
        # The filter before this one was gone for too long, if the vehicle lies on the ground.
        if (motion := self._measured.fresh) is not None:
            self._has_to_look = False
            if motion.position[2] < LYING_HEIGHT:
                self._stop_motors(Mode.DOWN, "the vehicle was on the ground when the filter began")

    # The end.

    def stop(self, reason: str) -> None:
        """Stop the motors now and until `reset`, whatever comes."""
        if self.mode is not Mode.EMERGENCY:
            self._stop_motors(Mode.EMERGENCY, reason)

    def reset(self) -> None:
        """Let the next takeoff have the vehicle again.

        Raises
        ------
        RefusalError
            Nothing has stopped the motors, or the vehicle may not be on the ground yet.
        """
        if self.mode is not Mode.EMERGENCY:
            raise RefusalError("there is no emergency")
        if self._in_mode < RESET_DELAY:
            raise RefusalError(
                f"the motors were stopped less than {RESET_DELAY:g} s ago; see that the vehicle "
                "lies still"
            )
        self._enter(Mode.DOWN, "reset after an emergency")

    @property
    def _is_on_ground(self):
        is_off = self.mode in (Mode.DOWN, Mode.EMERGENCY)
        return is_off or (self.mode is Mode.PASSING and self._choice.is_on_ground)

    def _look_after_flight(self, time, step):
        height = self._relay.landing_height if self.mode is Mode.PASSING else None
        crash, objection = self._watch.advance(time, step, height)
        if crash and not self._is_on_ground:
            self.stop(crash)
        if objection and not self._is_on_ground:
            self._land(objection)
        self._land_if_contended()

    def _land_if_contended(self):
        if self._watch.contention and not self._is_on_ground:
            self._land(self._watch.contention)

    def _land(self, reason):
        if not self.mode.is_final:
            self._sink(reason, f"{reason}; the filter lands")

    def _has_waited(self):
        is_flying = self._choice.remembered is FlightState.FLYING
        longest = self._patience.place if is_flying else self._patience.recovery
        blind = min(self._in_mode, self._measured.age)
        return self._in_mode > longest or blind > self._patience.recovery

    def _sink(self, cause, reason):
        self._cause = cause
        self._descent_limit = self._patience.descent
        if (motion := self._measured.fresh) is not None:
            self._descent_limit += descent_time(motion, self._relay.ground)
        if self.mode is Mode.PASSING:
            self._take_over(Mode.SINKING, reason)
        self._enter(Mode.SINKING, reason)

    def _take_over(self, mode, reason):
        # The state stops before the control does: the last one is what there is.
        motion, age = self._measured.within(LAST_STATE), self._measured.age
        self._safe = SafeControl(self._relay.hover, motion, age, self._relay.passed)
        self._enter(mode, reason)

    def _end_of_descent(self):
        motion = self._measured.fresh
        if motion is not None:
            is_low = motion.position[2] - self._relay.ground < TOUCHDOWN_HEIGHT
            if is_low and motion.velocity[2] > -STANDING_SPEED:
                return f"brought down by the filter because {self._cause}"
        if self._in_mode > self._descent_limit:
            return f"motors stopped after {self._descent_limit:.1f} s of descent: {self._cause}"
        return ""

    def _stop_motors(self, mode, reason):
        self._enter(mode, reason)
        self._choice.end_flight()

    def _enter(self, mode, reason):
        if mode is not self.mode:
            self._in_mode = 0.0
        self.mode = mode
        self._reason = reason
