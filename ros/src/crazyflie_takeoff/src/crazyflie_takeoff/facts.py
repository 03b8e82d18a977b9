"""What the supervisor knows now; each fact has one place here, and one owner who says it.

Two clocks: ``now`` is the time of the last input, s, and ``ran`` the time for which this process
has run, s. Silences are measured by the latter: if a clock was set, or the process was stopped for
a while, a silence is not as long as it seems. A state ages by the former.
"""

import math
from dataclasses import dataclass
from typing import Any

from crazyflie_takeoff.envelope import (
    Box,
    Limits,
    Walls,
    cannot_climb_too_far,
    is_any_within_pause,
)
from crazyflie_takeoff.fallback import (
    AVERAGING,
    LAST_AVERAGING,
    LAST_DIFFERENCE,
    LONGEST_STEP,
    SafeSetpoint,
)
from crazyflie_takeoff.hover_thrust import HoverThrust
from crazyflie_takeoff.motion import (
    PROGRESS,
    TOUCHDOWN_HEIGHT,
    Ground,
    Measured,
    Motion,
)
from crazyflie_takeoff.phases import FlightState
from crazyflie_takeoff.publishers import OVERLAP, Pauses, Publishers
from crazyflie_takeoff.vehicle_facts import VehicleFacts

TAKEOFF_CONTROL_LIMIT = 0.5  #: Age of a takeoff control up to which it excludes commanded ones (s).
#: Age up to which no control is late (s): three periods of a controller at 100 Hz.
SHORTEST_HOLD = 0.03
#: Without a given timeout, a control is late after three usual periods, but not before the first
#: time, and after the second one at the latest (s).
USUAL_HOLD, LONGEST_HOLD = 0.1, 0.5
PERIOD_AVERAGING = 0.1  #: Share of the last period in the usual one.
LEARNING_STEP = 0.2  #: Longest time between states from which hover is learned (s).
HANDOVER = 3  #: Most changes between publishers in a handover from one controller to another.


@dataclass(frozen=True)
class Timeouts:
    """Timeouts after a loss, s."""

    # Time from the last control until the vehicle is held, at least `SHORTEST_HOLD`; None: three
    # of the controller's usual periods, see `USUAL_HOLD`.
    hold: float | None
    recovery: float  # Then until the descent: without a state, and in a takeoff or a landing.
    descent: float  # Then until the motors stop; plus the duration of the descent if it is known.
    place: float  # The same as ``recovery`` for a vehicle in flight whose state is known.


@dataclass(slots=True)
class Heard:
    """The last control of a source: the message, its numbers, and when it came by both clocks."""

    control: Any = None
    setpoint: SafeSetpoint | None = None
    now: float = -math.inf
    ran: float = -math.inf
    age: float = 0.0  # Of its data when it came, beyond the usual one (s).


class Facts:
    """What is known of a vehicle, its flight, its controls and this process.

    ``sees`` is whether states are received, ``vehicle`` what the driver says; None without one.
    """

    def __init__(
        self,
        timeouts: Timeouts,
        limits: Limits,
        sees: bool = False,
        vehicle: VehicleFacts | None = None,
    ):
        self.timeouts = timeouts
        #: Age at which a control is late, s.
        self.hold = USUAL_HOLD if timeouts.hold is None else max(timeouts.hold, SHORTEST_HOLD)
        self._period = 0.0  # The controller's usual period (s).
        self.limits = limits
        self.sees = sees
        self.now, self.ran = math.nan, 0.0
        self.pauses = Pauses()
        self._pause = 0.0  # Longest pause since `look` (s).
        self._looked = math.nan
        # The state, and what follows from it.
        self.measured = Measured()
        self.first_seen = math.inf  #: `ran` at the first state (s).
        self.is_tilted = False
        self.walls = Walls(limits)
        self.outside = ""  #: What is wrong with the position; empty if nothing is.
        self.ground = Ground()
        self.is_near_limit = False  #: Whether controls in their ranges may climb too far.
        self.set_hover(None)
        #: The commanded control that flies the vehicle; None while another one does.
        self.flown: Any = None
        self._learned = math.nan
        #: Time for which the thrust of hover was learned since this flight began (s).
        self.learned_for = 0.0
        self.vehicle = vehicle
        # The flight, as the server says: its state, or the toggles of in_flight before that.
        self.flight: FlightState | None = None
        self.takeoff_called = -math.inf  #: `ran` when the server began its last takeoff (s).
        self.toggled = False
        #: Whether a server would have told of a flight by now.
        self.has_listened = False
        # Controls.
        self.takeoff = Heard()  #: The last takeoff control.
        self.kept = Heard()  #: The last one that counts; nothing after the end of a flight.
        self.commanded = Heard(ran=0.0)  #: A filter that starts in flight is not connected at once.
        self.is_commanded = False  #: Whether a commanded control has ever come.
        # The server is silent in flight: another one at once is a second one.
        self.servers = Publishers("takeoff controls", 0)
        self.controllers = Publishers("commanded controls", HANDOVER)
        #: Which limit of a climb the last control exceeds; empty if it exceeds none.
        self.climb_excess = ""
        self._lowest: float | None = None  # Height that a descent has reached (m).
        # `ran` when no server was there (s), and when a flight ended for want of controls.
        self.server_missed, self.controller_failed = -math.inf, -math.inf
        self.emergency = ""  #: Who has called for an emergency; empty after the reset.
        self.is_reset = False  #: Whether a reset has been called since.

    # Time.

    def advance(self, now: float) -> None:
        """Advance both clocks to ``now`` (s)."""
        step = now - self.now
        if step > 0.0:
            self.ran += min(step, LONGEST_STEP)
            if step > self._pause:
                self._pause = step
        elif step < 0.0:
            # The clock was reset: what is known goes on from there.
            for heard in (self.takeoff, self.kept, self.commanded):
                heard.now += step
            self._looked = now
        self.now = now

    def look(self) -> None:
        """Update what depends on the time alone; once for each input that is not nominal."""
        elapsed = self.now - self._looked
        self._looked = self.now
        if elapsed > 0.0:
            # One that is longer than `LONGEST_STEP` ends the nominal case, so there is one at most.
            self.pauses.note(elapsed - self._pause, 0.0)
            self.pauses.note(self._pause, self._pause)
            self._pause = 0.0
        self.servers.advance(self.now)
        if self.flown is not None:
            self.controllers.renew(self.commanded.now)
        self.controllers.advance(self.now)

    # State.

    def measure(self, now: float, motion: Motion, age: float = 0.0) -> None:
        """Process a state that was measured ``age`` s ago."""
        self.advance(now)
        self.first_seen = min(self.first_seen, self.ran)
        self.measured.update(now, motion, age)
        self.ground.measure(motion, self.server_reports_ground, self.in_flight)
        self.outside = self.walls.complaint(motion.position)
        self.is_near_limit = not cannot_climb_too_far(motion, self.highest, self.limits.climb)
        self.learn()

    @property
    def seen(self) -> Motion | None:
        """The motion, unless it is older than `MAX_FEEDBACK_AGE`."""
        return self.measured.within(self.now)

    @property
    def highest(self) -> float:
        """The largest z of a climb, m."""
        return self.walls.highest(self.ground.z)

    def set_box(self, box: Box) -> None:
        """Set the box of the geofence."""
        self.walls.change(box.without_floor())

    def set_hover(self, thrust: float | None) -> None:
        """Begin with a thrust of hover, m/s^2, such as that of the server's liftoff."""
        self._hover_mean = HoverThrust(AVERAGING, thrust)
        self._last_hover = HoverThrust(LAST_AVERAGING, thrust)

    def learn(self) -> None:
        """Learn the thrust of hover from the control that has flown the vehicle until now."""
        step, self._learned = self.now - self._learned, self.now
        motion = self.seen
        speed = None if motion is None else motion.velocity[2]
        # A late control fades.
        is_late = self.needs_controller and self.silence > 0.5 * self.hold
        if self.flown is None or is_late or not 0.0 < step < LEARNING_STEP:
            if step != 0.0:
                self._hover_mean.skip(speed)
                self._last_hover.skip(speed)
            return
        self.learned_for += step
        lift = lift_of(self.flown)
        self._hover_mean.update(step, lift, speed)
        self._last_hover.update(step, lift, speed)

    @property
    def hover(self) -> float:
        """Thrust of hover that was learned in flight, m/s^2; by the last motion if it is less."""
        mean, last = self._hover_mean.value, self._last_hover.value
        return last if last < (1.0 - LAST_DIFFERENCE) * mean else mean

    @property
    def stays_up(self) -> bool:
        """Whether a vehicle that is to land has not come down since the last call."""
        motion = self.seen
        height = None if motion is None or not self.lands else self.ground.height(motion)
        if height is None or height <= TOUCHDOWN_HEIGHT:
            self._lowest = None
            return False
        lowest, self._lowest = self._lowest, height
        if lowest is None or height <= lowest - PROGRESS:
            return False
        self._lowest = max(lowest, height)
        return True

    # Flight.

    def hear_flight(self, now: float, state: FlightState) -> None:
        """Record the flight state that the server says."""
        self.advance(now)
        if state is FlightState.TAKING_OFF and self.flight is not state:
            self.takeoff_called = self.ran
        self.flight = state

    @property
    def in_flight(self) -> bool:
        """Whether the vehicle is in flight, by the flight state or else by the toggles.

        Once a flight state is known, only it decides, so that a toggle and a state of the same
        event cannot cancel each other.
        """
        return self.toggled if self.flight is None else self.flight.in_flight

    @property
    def remembered(self) -> FlightState | None:
        """The flight state for a server that has been restarted; None if unknown.

        A toggle to the ground is not remembered: if one toggle was missed, it means flight.
        """
        if self.flight is None and self.toggled:
            return FlightState.FLYING
        return self.flight

    @property
    def lands(self) -> bool:
        """Whether the controller is to bring the vehicle down."""
        return self.flight is FlightState.DESCENDING

    @property
    def stands(self) -> bool:
        """Whether nothing shows that the vehicle is off the ground."""
        if self.in_flight or self.kept_thrust > 0.0:
            return False
        # At the end of a landing, zero thrust means that the vehicle is on the ground.
        return self.flight is not FlightState.TAKING_OFF

    @property
    def server_reports_ground(self) -> bool:
        """Whether the server sends zero thrust to a vehicle on the ground."""
        sends_zero = self.kept.setpoint is not None and self.kept_thrust <= 0.0
        is_there = self.flight in (None, FlightState.ON_GROUND)
        return sends_zero and not self.in_flight and is_there

    def end_flight(self) -> None:
        """Forget the flight: the motors are off, and nothing restores it."""
        self.toggled = False
        self.kept = Heard()
        self.flown = None

    # Controls.

    @property
    def kept_thrust(self) -> float:
        """Thrust of the last takeoff control that has passed, m/s^2."""
        return 0.0 if self.kept.setpoint is None else self.kept.setpoint.thrust

    @property
    def takeoff_age(self) -> float:
        """Age of the last takeoff control that has passed, s; infinite without one."""
        return self.now - self.kept.now

    @property
    def silence(self) -> float:
        """Time since the last commanded control, s."""
        return self.ran - self.commanded.ran

    @property
    def needs_controller(self) -> bool:
        """Whether the vehicle would fall without the controller.

        That is the case in flight, unless a takeoff control has just come. It is also the case
        between takeoff and flight, and if the server has died above the ground, once the last
        takeoff control is older than `TAKEOFF_CONTROL_LIMIT`.
        """
        if self.in_flight:
            return self.takeoff_age > self.hold
        return not self.stands and self.takeoff_age > TAKEOFF_CONTROL_LIMIT

    @property
    def contention(self) -> str:
        """Message that two nodes publish the same controls; empty if they do not."""
        return self.servers.complaint or self.controllers.complaint

    @property
    def may_lack_reference(self) -> bool:
        """Whether there was no server for a while since the last control.

        Without a reference of the server, the controller is silent.
        """
        return self.server_missed > max(self.commanded.ran, self.takeoff.ran)

    @property
    def lacks_controller(self) -> bool:
        """Whether a flight was ended because no control came, and none has come since."""
        return self.controller_failed > self.commanded.ran

    def hear_takeoff(
        self, now: float, control: Any, setpoint: SafeSetpoint, name: str = "", stands: bool = False
    ) -> None:
        """Record a takeoff control of the node ``name``; its numbers are ``setpoint``.

        ``stands`` is whether the vehicle is on the ground, where a second server does no harm.
        """
        self.advance(now)
        self.servers.note(now, name, OVERLAP if stands else math.inf)
        self.takeoff = Heard(control, setpoint, now, self.ran)

    def hear_commanded(
        self, now: float, control: Any, setpoint: SafeSetpoint, name: str = "", age: float = 0.0
    ) -> None:
        """Record a commanded control whose data were measured ``age`` s earlier than usual.

        It is treated as if it had come that much earlier.
        """
        self.advance(now)
        if self.flown is not None:
            # Those that have passed without a look came from the same node.
            self.controllers.renew(self.commanded.now)
        self.controllers.note(now, name)
        self.measure_period(now)
        ran = max(self.commanded.ran, self.ran - age)
        self.commanded = Heard(control, setpoint, now, ran, age)
        self.is_commanded = True

    def measure_period(self, now: float) -> None:
        """Measure the controller's period, at a commanded control before it is noted."""
        if self.timeouts.hold is None and self.is_commanded:
            period = min(max(now - self.commanded.now, 0.0), LONGEST_HOLD)
            self._period += PERIOD_AVERAGING * (period - self._period)
            self.hold = min(max(3.0 * self._period, USUAL_HOLD), LONGEST_HOLD)

    @property
    def is_free(self) -> bool:
        """Whether a commanded control in its ranges may pass unchanged in flight."""
        is_clear = not (self.emergency or self.is_tilted or self.outside or self.climb_excess)
        is_known = not (self.contention or self.may_lack_reference or self.lacks_controller)
        if not (is_clear and is_known) or self.is_near_limit:
            return False
        return is_any_within_pause(max(self.pauses.longest, self._pause))


def lift_of(control: Any) -> float:
    """Return the vertical part of the thrust of a control with the fields of a setpoint, m/s^2."""
    return control.thrust * math.cos(control.roll) * math.cos(control.pitch)
