"""What is passed on of the controls that come: which one, within which limits, and for how long."""

import math
from typing import Generic

from crazyflie_model.limits import MIN_THRUST
from crazyflie_takeoff.control_filter import TAKEOFF_CONTROL_LIMIT, Control, ControlFilter
from crazyflie_takeoff.control_limits import in_range
from crazyflie_takeoff.flight_state import FlightState
from crazyflie_takeoff.flight_watch import FlightWatch
from crazyflie_takeoff.ground import TOUCHDOWN_HEIGHT, Ground
from crazyflie_takeoff.limits import Limits
from crazyflie_takeoff.motion import Measurement, Motion
from crazyflie_takeoff.safe_control import MOTORS_OFF, HoverThrust, Setpoint

LEARNING_STEP = 0.2  #: Nothing is learned from controls that are further apart, s.


class Relay(Generic[Control]):
    """Chooses between controls, limits them, and fades late ones to hover.

    A control counts in full for half of ``hold`` (s), and is level hover from ``hold`` on.
    """

    def __init__(self, limits: Limits, hold: float):
        self.choice: ControlFilter[Control] = ControlFilter()
        self.watch = FlightWatch(limits)
        self.measured = Measurement()
        self.ground = Ground()
        self._hold = hold
        self._hover = HoverThrust()
        self._time = math.nan
        self._commanded = self._allowed_command = MOTORS_OFF
        self._passed = self._takeoff = MOTORS_OFF

    @property
    def hover(self) -> float:
        """Thrust of hover, as learned in flight, m/s^2."""
        return self._hover.value

    @property
    def passed(self) -> Setpoint:
        """The last control that was passed on; level hover before the first commanded one."""
        return self._passed if math.isfinite(self._time) else self._level

    @property
    def _level(self):
        return Setpoint(0.0, 0.0, 0.0, self.hover)

    @property
    def _is_landing(self):
        return self.choice.remembered is FlightState.DESCENDING

    @property
    def landing_height(self) -> float | None:
        """Height of a vehicle that its controller is to bring down, m; None of any other."""
        motion = self.measured.fresh
        if motion is None or not self._is_landing:
            return None
        height = self.ground.height(motion)
        return height if height > TOUCHDOWN_HEIGHT else None

    def measure(self, motion: Motion, age: float = 0.0) -> None:
        """Take a state that was measured ``age`` s ago."""
        self.measured.update(motion, age)
        self.watch.measure(motion, age)
        choice = self.choice
        self.ground.measure(motion, choice.server_reports_ground, choice.in_flight)

    def takeoff(self, time: float, control: Control, setpoint: Setpoint) -> Control | Setpoint:
        """Return what to pass on of a takeoff control."""
        self.choice.takeoff(time, control, setpoint.thrust)
        self._takeoff = self._allowed(setpoint, 0.0, is_ramp=True)
        return control if self._takeoff == setpoint else self._takeoff

    def choose(self, time: float, control: Control, setpoint: Setpoint) -> Control | None:
        """Return the control that is selected when a commanded one has come, or None."""
        self._commanded = setpoint
        return self.choice.commanded(time, control)

    def commanded(
        self, time: float, control: Control, age: float, is_on_ground: bool
    ) -> Control | Setpoint:
        """Return what to pass on of the last commanded control, which is ``age`` s old.

        On the ground nothing is learned from it.
        """
        allowed = self._allowed(self._commanded, MIN_THRUST if self.choice.in_flight else 0.0)
        step = time - self._time
        if 0.0 < step < LEARNING_STEP and not is_on_ground:
            motion = self.measured.fresh
            self._hover.update(step, allowed, None if motion is None else motion.velocity[2])
        self._time = time
        self._passed = self._allowed_command = allowed
        if age > 0.5 * self._hold:
            return self._faded(allowed, age)
        return control if allowed == self._commanded else allowed

    def mixed(self, own: Setpoint, weight: float) -> Setpoint:
        """Return the last commanded control with a weight (0 ... 1), and ``own`` for the rest."""
        self._passed = own.mixed(self._allowed_command, weight)
        return self._passed

    def repeated(self, control: Control, time: float) -> Control | Setpoint:
        """Return the last takeoff control once more: thrust above hover is not kept for long."""
        age = self.choice.takeoff_age(time)
        if self._takeoff.thrust <= self.hover or age <= 0.5 * self._hold:
            return control
        return self._faded(self._takeoff, age)

    def late(self, time: float, silence: float, is_needed: bool) -> Setpoint | None:
        """Return what replaces a control that is late, or None.

        It is that of the controller, ``silence`` s old, if it ``is_needed``, else the server's.
        """
        if is_needed:
            is_late = silence > 0.5 * self._hold and math.isfinite(self._time)
            return self._faded(self._passed, silence) if is_late else None
        age = self.choice.takeoff_age(time)
        is_late = 0.5 * self._hold < age <= TAKEOFF_CONTROL_LIMIT and not self.choice.is_on_ground
        if self.choice.in_flight or not is_late or self._takeoff.thrust <= self.hover:
            return None
        return self._faded(self._takeoff, age)

    def _allowed(self, setpoint, lowest, is_ramp=False):
        watch, motion, hover = self.watch, self.measured.fresh, self.hover
        control = in_range(setpoint, lowest)
        highest = watch.walls.highest(self.ground.z)
        thrust = watch.climb.apply(control.thrust, hover, motion, highest, self._is_landing)
        speed = 0.0 if motion is None else motion.velocity[2]
        return watch.gaps.apply(control._replace(thrust=thrust), hover, speed, is_ramp)

    def _faded(self, setpoint, age):
        weight = min(max(age / (0.5 * self._hold) - 1.0, 0.0), 1.0)
        return setpoint.mixed(self._level, weight)
