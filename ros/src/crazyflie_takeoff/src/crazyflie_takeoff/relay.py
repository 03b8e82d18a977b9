"""The controls that the filter passes on, and their limits."""

import math
from typing import Any, TypeVar

from crazyflie_model.limits import MIN_THRUST
from crazyflie_takeoff.limits import (
    Callers,
    ClimbLimit,
    Debounce,
    DescentWatch,
    Limits,
    RunGaps,
    Walls,
)
from crazyflie_takeoff.motion import TOUCHDOWN_HEIGHT, Ground, Measurement, Motion
from crazyflie_takeoff.safe_control import (
    LAST_AVERAGING,
    LAST_DIFFERENCE,
    MOTORS_OFF,
    HoverThrust,
    SafeSetpoint,
)

LEARNING_STEP = 0.2  #: Longest time between controls from which hover is learned (s).
HANDOVER = 3  #: Most changes between publishers in a handover from one controller to another.
CRASH_DURATION = 0.1  #: Time for which a position is wrong in a crash (s).

Control = TypeVar("Control")


class Relay:
    """Limits controls, fades late ones to hover, and watches the flight that they make.

    A control is unchanged for half of ``hold`` (s), and is level hover from ``hold`` on.
    """

    def __init__(self, limits: Limits, hold: float):
        self.measured = Measurement()
        self.ground = Ground()
        self.walls = Walls(limits)
        self.gaps = RunGaps()
        #: Whether the vehicle is tilted further than in any flight.
        self.is_tilted = False
        # The server is silent in flight: another one at once is a second one.
        self.takeoff_callers = Callers("takeoff controls", 0)
        self.commanded_callers = Callers("commanded controls", HANDOVER)
        self._limits = limits
        self._hold = hold
        self._hover, self._last_hover = HoverThrust(), HoverThrust(LAST_AVERAGING)
        self._climb = ClimbLimit(limits.climb)
        self._descent = DescentWatch()
        self._position_complaint = ""
        self._position_debounce = Debounce(CRASH_DURATION)
        self._time = math.nan
        self._command = self._allowed_command = self._passed = MOTORS_OFF
        self._takeoff = MOTORS_OFF
        # Summary of the controls that have passed unchanged since the last `flush`: the last one,
        # the time for which they have flown (s), the integral of their vertical thrust (m/s), and
        # the longest gap before one of them (s).
        self._unchanged: Any = None
        self._duration = self._impulse = self._gap = 0.0

    @property
    def hover(self) -> float:
        """Thrust of hover that was learned in flight, m/s^2."""
        return self._hover.value

    @property
    def blind_hover(self) -> float:
        """The same for a vehicle without a state: by its last motion, if that is less, m/s^2."""
        hover, last = self.hover, self._last_hover.value
        return last if last < (1.0 - LAST_DIFFERENCE) * hover else hover

    @property
    def passed(self) -> SafeSetpoint:
        """The last control that was passed on; level hover before the first commanded one."""
        return self._passed if math.isfinite(self._time) else self._level

    @property
    def _level(self):
        return SafeSetpoint(0.0, 0.0, 0.0, self.hover)

    @property
    def is_nominal(self) -> bool:
        """Whether nothing has been measured that would stop the motors."""
        return not (self.is_tilted or self._position_complaint)

    @property
    def is_free(self) -> bool:
        """Whether a commanded control in its ranges is passed on unchanged in flight."""
        is_clear = self.is_nominal and self.gaps.is_free and not self.contention
        motion = self.measured.fresh
        return is_clear and self._climb.is_free(motion, self.walls.highest(self.ground.z))

    @property
    def contention(self) -> str:
        """Message that two nodes publish the same controls; empty if they do not."""
        return self.takeoff_callers.complaint or self.commanded_callers.complaint

    def measure(self, motion: Motion, age: float, is_on_ground: bool, in_flight: bool) -> None:
        """Process a state, measured ``age`` s ago, and whether the server reports ground."""
        self.measured.update(motion, age)
        self.ground.measure(motion, is_on_ground, in_flight)
        self._position_complaint = self.walls.complaint(motion.position)

    def advance(self, time: float, elapsed: float) -> None:
        """Advance to ``time``, by ``elapsed`` (s)."""
        self.measured.age += elapsed
        self.gaps.run(time)
        self.takeoff_callers.advance(time)
        self.commanded_callers.advance(time)

    def complaints(self, step: float, lands: bool) -> tuple[str, str]:
        """Return a crash and an objection, ``step`` s after the last call; both may be empty.

        ``lands`` is whether the controller is to bring the vehicle down. A crash is the reason for
        which the motors are stopped in the air, an objection that for which the vehicle is landed.
        They are empty while `is_free` holds, as at the last call, and the vehicle is not to land.
        """
        motion = self.measured.fresh
        crash = self._position_debounce.advance(
            step, "" if motion is None else self._position_complaint
        )
        if self.is_tilted:
            crash = "the vehicle has tilted over"
        height = None if motion is None or not lands else self.ground.height(motion)
        is_high = height is not None and height > TOUCHDOWN_HEIGHT
        objection = self._climb.advance(step) or self.gaps.complaint
        return crash, self._descent.advance(step, height if is_high else None) or objection

    # Controls.

    def pass_unchanged(self, time: float, control: Any) -> bool:
        """Accept a commanded control while `is_free` holds; return False if it is out of range.

        ``control`` has the fields of a `SafeSetpoint`.
        """
        roll, pitch, thrust = control.roll, control.pitch, control.thrust
        limits = self._limits
        if not (
            -limits.tilt <= roll <= limits.tilt
            and -limits.tilt <= pitch <= limits.tilt
            and MIN_THRUST <= thrust <= limits.thrust
            and -limits.yaw_rate <= control.yaw_dot <= limits.yaw_rate
        ):
            return False
        step, self._time = time - self._time, time
        if step > self._gap:
            self._gap = max(self._gap, min(step, time - self.gaps.time))
        self._duration += step
        self._impulse += step * thrust * math.cos(roll) * math.cos(pitch)
        self._unchanged = control
        return True

    def flush(self) -> None:
        """Learn from the controls that have passed unchanged since the last call."""
        if (control := self._unchanged) is None:
            return
        setpoint = SafeSetpoint(control.roll, control.pitch, control.yaw_dot, control.thrust)
        self._command = self._allowed_command = self._passed = setpoint
        if self._duration > 0.0:
            self._learn(self._duration, self._impulse / self._duration)
        self.gaps.run(self._time, self._gap)
        self.commanded_callers.renew(self._time)
        self._unchanged, self._duration, self._impulse, self._gap = None, 0.0, 0.0, 0.0

    def takeoff(
        self, control: Control, setpoint: SafeSetpoint, lands: bool
    ) -> Control | SafeSetpoint:
        """Return a takeoff control as it is passed on."""
        self._takeoff = self._allowed(setpoint, 0.0, lands, is_ramp=True)
        return control if self._takeoff == setpoint else self._takeoff

    def command(self, setpoint: SafeSetpoint) -> None:
        """Set the last commanded control."""
        self._command = setpoint

    def commanded(
        self,
        time: float,
        control: Control,
        age: float,
        in_flight: bool,
        lands: bool = False,
        learns: bool = True,
    ) -> Control | SafeSetpoint:
        """Return the last commanded control, whose data are ``age`` s late, as it is passed on.

        ``learns`` is whether the thrust of hover is learned from it.
        """
        allowed = self._allowed(self._command, MIN_THRUST if in_flight else 0.0, lands)
        if learns:
            self._learn(time - self._time, allowed.lift)
        self._time = time
        self._passed = self._allowed_command = allowed
        if age > 0.5 * self._hold:
            return self._faded(allowed, age)
        return control if allowed == self._command else allowed

    def mixed(self, own: SafeSetpoint, weight: float) -> SafeSetpoint:
        """Return the mean of ``own`` and the last commanded control, which has a weight (0-1)."""
        self._passed = own.mixed(self._allowed_command, weight)
        return self._passed

    def late(self, silence: float) -> SafeSetpoint | None:
        """Return the control that replaces one ``silence`` s ago; None if it is not late."""
        is_late = silence > 0.5 * self._hold and math.isfinite(self._time)
        return self._faded(self._passed, silence) if is_late else None

    def late_takeoff(self, age: float) -> SafeSetpoint | None:
        """Return the control that replaces the last takeoff control; None if it is not late.

        ``age`` is that of the takeoff control, s. Less thrust than that of hover belongs to a ramp,
        which goes on.
        """
        is_late = age > 0.5 * self._hold and self._takeoff.thrust > self.hover
        return self._faded(self._takeoff, age) if is_late else None

    def _learn(self, step, lift):
        motion = self.measured.fresh
        speed = None if motion is None else motion.velocity[2]
        for hover in (self._hover, self._last_hover):
            if 0.0 < step < LEARNING_STEP:
                hover.update(step, lift, speed)
            elif step >= LEARNING_STEP:
                hover.skip(speed)

    def _allowed(self, setpoint, lowest, lands, is_ramp=False):
        motion, hover = self.measured.fresh, self.hover
        control = self._limits.in_range(setpoint, lowest)
        highest = self.walls.highest(self.ground.z)
        thrust = self._climb.apply(control.thrust, hover, motion, highest, lands)
        speed = 0.0 if motion is None else motion.velocity[2]
        return self.gaps.apply(control._replace(thrust=thrust), hover, speed, is_ramp)

    def _faded(self, setpoint, age):
        weight = min(max(age / (0.5 * self._hold) - 1.0, 0.0), 1.0)
        return setpoint.mixed(self._level, weight)
