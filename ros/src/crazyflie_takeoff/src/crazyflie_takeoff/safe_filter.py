"""The control filter with what makes it safe: it is the last one before the vehicle."""

import enum
import math
from dataclasses import dataclass
from typing import Generic

from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.control_filter import Control, ControlFilter
from crazyflie_takeoff.flight import TOUCHDOWN_HEIGHT
from crazyflie_takeoff.flight_state import SEPARATOR, FlightState, Takeover
from crazyflie_takeoff.limits import FRESHNESS, Limits, Persistence
from crazyflie_takeoff.safe_control import (
    MOTORS_OFF,
    RETURN_TIME,
    SINK_SPEED,
    HoverThrust,
    SafeControl,
    Setpoint,
)
from crazyflie_utils.refusal import RefusalError

LONGEST_STEP = 0.05
"""More time than this never passes between two ticks, s: after a clock was set, or the process
was stopped for a while, nobody has been silent for as long as it seems."""

STANDING_SPEED = 0.1
"""A vehicle near the ground that sinks slower than this has met it, m/s."""

LYING_HEIGHT = 0.1
"""A vehicle below this when the filter starts has come down without it, m."""

RESET_DELAY = 2.0
"""How long after the motors were stopped they cannot be released, s: the vehicle may still fall."""


class Mode(enum.Enum):
    """Who has the vehicle.

    PASSING: who publishes controls. HOLDING and SINKING: the filter, until
    the controller comes back or for good. DOWN: nobody until the next takeoff. EMERGENCY: nobody
    until the filter is reset.
    """

    PASSING = enum.auto()
    HOLDING = enum.auto()
    SINKING = enum.auto()
    DOWN = enum.auto()
    EMERGENCY = enum.auto()

    @property
    def is_final(self) -> bool:
        """Whether controls are not passed on any more."""
        return self in (Mode.SINKING, Mode.DOWN, Mode.EMERGENCY)


_TAKEOVERS = {
    Mode.SINKING: Takeover.SINKING,
    Mode.DOWN: Takeover.DOWN,
    Mode.EMERGENCY: Takeover.EMERGENCY,
}


@dataclass(frozen=True)
class Patience:
    """How long a filter waits.

    Attributes
    ----------
    hold : float
        For a control in flight, before it takes over, s.
    recovery : float
        For the control to come back, before the descent begins, s.
    descent : float
        For the touchdown, before it stops the motors, s; and while the height is known, as
        much longer as the way down takes.
    """

    hold: float
    recovery: float
    descent: float


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
        self._limits = limits
        self._choice: ControlFilter[Control] = ControlFilter()
        self._reason = ""
        self._ticked = math.nan
        self._in_mode = 0.0
        # As if one had just come: a filter that starts in flight is not connected at once.
        self._silence = 0.0
        self._lacks_control = False
        self._position_limit = Persistence()
        self._is_tilted = False
        self._height = self._speed = 0.0
        self._state_age = math.inf
        self._ground = 0.0
        self._hover = HoverThrust()
        self._commanded_time = math.nan
        self._safe = SafeControl(self._hover.value, 0.0)
        self._descent_limit = 0.0
        self._own = MOTORS_OFF
        self._return_age = math.inf

    # What it says.

    @property
    def hover_thrust(self) -> float:
        """What it has learned about the vehicle, m/s^2."""
        return self._hover.value

    @property
    def control_age(self) -> float:
        """How long no commanded control has come, s."""
        return max(self._silence, 0.0)

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
        return _TAKEOVERS.get(self.mode)

    @property
    def is_calm(self) -> bool:
        """Whether nothing can happen within half the time for which it holds on."""
        is_heard = self._silence < 0.5 * self._patience.hold or self._is_on_ground
        is_settled = self.mode is Mode.PASSING and self._return_age >= RETURN_TIME
        is_well = not (self._has_to_look or self._is_tilted or self._position_limit.is_wrong)
        return is_settled and is_heard and is_well

    @property
    def explanation(self) -> str:
        """Why it is so, to be published behind a word; empty if all is well."""
        return SEPARATOR + self._reason if self.mode is not Mode.PASSING and self._reason else ""

    # What it is told.

    def toggle(self) -> None:
        """Take note of a toggle of in_flight; none of them brings back a flight that has ended."""
        if not self.mode.is_final:
            self._choice.toggle()

    def set_state(self, state: FlightState) -> None:
        """Take note of the server's flight state."""
        self._choice.set_state(state)

    def set_height(self, position: tuple[float, float, float], speed: float) -> None:
        """Take a measured position (m) and z_dot (m/s)."""
        self._height, self._speed = position[2], speed
        self._state_age = 0.0
        self._position_limit.measure(self._limits.of_position(position))
        if self._choice.stands:
            self._ground = position[2]

    def set_tilted(self, is_tilted: bool) -> None:
        """Take note of whether the vehicle is tilted as only one that crashes is."""
        self._is_tilted = is_tilted

    def controller_left(self) -> None:
        """Take note that nobody publishes commanded controls: whoever comes next is new."""
        self._lacks_control = False

    # Controls.

    def takeoff(self, time: float, control: Control, thrust: float) -> Control | None:
        """Return what to pass on when a takeoff control has come; see `ControlFilter.takeoff`."""
        if self.mode in (Mode.SINKING, Mode.EMERGENCY):
            return None
        if self.mode is Mode.DOWN:
            # That of a landing lifts nothing.
            if thrust <= GRAVITY:
                return None
            self._choice.end_flight()
        self._enter(Mode.PASSING, "")
        self._has_to_look = False
        self._return_age = math.inf
        return self._choice.takeoff(time, control, thrust)

    def commanded(
        self, time: float, control: Control, setpoint: Setpoint
    ) -> Control | Setpoint | None:
        """Return what to pass on when a commanded control has come.

        Parameters
        ----------
        time : float
            Now, s.
        control : object
        setpoint : Setpoint
            Its numbers.
        """
        # The next tick adds all of its step.
        self._silence = -self._step_until(time)
        self._lacks_control = False
        chosen = self._choice.commanded(time, control)
        if self._has_to_look and self._choice.in_flight:
            self._look()
        if self.mode.is_final or (self._has_to_look and self._choice.in_flight):
            return None
        if chosen is not control:
            return chosen
        if self.mode is Mode.HOLDING:
            self._enter(Mode.PASSING, "")
            self._return_age = 0.0
        step = time - self._commanded_time
        if 0.0 < step < 2.0 * self._patience.hold and not self._is_on_ground:
            self._hover.update(step, setpoint, self._fresh_speed())
        self._commanded_time = time
        if self._return_age >= RETURN_TIME:
            return control
        return self._own.mixed(setpoint, self._return_age / RETURN_TIME)

    def stop_listening(self, time: float) -> Control | None:
        """Return what to pass on; see `ControlFilter.stop_listening`."""
        self._has_to_look = False
        waiting = self._choice.stop_listening(time)
        return None if self.mode.is_final else waiting

    def tick(self, time: float) -> Setpoint | None:
        """Let time pass until ``time`` (s); return what to publish, or None."""
        step = self._step_until(time)
        self._ticked = time
        self._in_mode += step
        self._silence += step
        self._state_age += step
        self._return_age += step
        self._watch_limits(step)
        is_needed = self._choice.is_controllers(time, self._patience.hold)
        if self.mode is Mode.PASSING and is_needed and self._silence > self._patience.hold:
            self.takeovers += 1
            self._safe = SafeControl(self._hover.value, self._speed if self._knows_speed else 0.0)
            self._enter(Mode.HOLDING, "no control comes, the filter keeps the vehicle level")
        elif self.mode is Mode.HOLDING and not is_needed:
            self._enter(Mode.PASSING, "")
        elif self.mode is Mode.HOLDING and self._in_mode > self._patience.recovery:
            self._begin_descent()
        elif self.mode is Mode.SINKING and (reason := self._end_of_descent()):
            self._stop_motors(Mode.DOWN, reason)
        if self.mode in (Mode.HOLDING, Mode.SINKING):
            sinks = self.mode is Mode.SINKING
            self._own = self._safe.advance(step, self._fresh_speed(), sinks)
            return self._own
        return MOTORS_OFF if self.mode in (Mode.DOWN, Mode.EMERGENCY) else None

    def _step_until(self, time):
        elapsed = time - self._ticked
        return min(max(elapsed, 0.0), LONGEST_STEP) if math.isfinite(elapsed) else 0.0

    def _look(self):
        # The filter before this one was gone for too long, if the vehicle lies on the ground.
        if self._state_age < FRESHNESS:
            self._has_to_look = False
            if self._height < LYING_HEIGHT:
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

    @property
    def _knows_speed(self):
        # The state stops before the control does: the last one is what there is.
        return self._state_age < FRESHNESS + self._patience.hold

    def _fresh_speed(self):
        return self._speed if self._state_age < self._patience.hold else None

    def _watch_limits(self, step):
        complaint = self._position_limit.advance(step)
        if self._is_tilted:
            complaint = "the vehicle has tilted over"
        if complaint and not self._is_on_ground:
            self.stop(complaint)

    def _begin_descent(self):
        self._lacks_control = True
        self._descent_limit = self._patience.descent
        if self._state_age < FRESHNESS:
            self._descent_limit += max(self._height - self._ground, 0.0) / SINK_SPEED
        waited = self._patience.hold + self._patience.recovery
        self._enter(Mode.SINKING, f"no control came for {waited:g} s")

    def _end_of_descent(self):
        is_low = self._height - self._ground < TOUCHDOWN_HEIGHT
        if self._state_age < FRESHNESS and is_low and self._speed > -STANDING_SPEED:
            return "brought down by the filter because no control came"
        if self._in_mode > self._descent_limit:
            return f"motors stopped {self._descent_limit:.1f} s after the controller was lost"
        return ""

    def _stop_motors(self, mode, reason):
        self._enter(mode, reason)
        self._choice.end_flight()

    def _enter(self, mode, reason):
        if mode is not self.mode:
            self._in_mode = 0.0
        self.mode = mode
        self._reason = reason
