"""Takeoff and landing: the states of the server, their transitions, and the machine.

Heights and positions are in the fixed frame (z up), m. Times are s of any clock that does not run
backwards; if it is reset, a takeoff or a landing continues from there.
"""

import enum
import math
from dataclasses import dataclass
from typing import NamedTuple

from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.guards import Guard, first_firing
from crazyflie_takeoff.hover_thrust import UNSEEN_THRUST
from crazyflie_takeoff.lift_off import LIFT_OFF_THRUST, LiftOff, has_lifted_off
from crazyflie_takeoff.motion import PROGRESS, TOUCHDOWN_HEIGHT, Position
from crazyflie_takeoff.phases import FilterState, FlightState
from crazyflie_takeoff.profiles import Descent, TakeoffPlan
from crazyflie_utils.refusal import RefusalError

#: Time after which a vehicle that is still on the ground is unable to fly (s).
LIFT_OFF_TIME = 3.0
#: Time of `UNSEEN_THRUST` before zero thrust after a liftoff that is not seen any more (s).
UNSEEN_TIME = 1.0
RAMP_DROP = 0.1  #: A vehicle that sinks further in the ramp was not on the ground (m).
TOUCHDOWN_LIMIT = 2.0  #: Longest time from the end of the ramp to the touchdown (s).
ZERO_THRUST_PERIOD = 0.1  #: Period of zero thrust on the ground (s).
#: Height above which a vehicle is in flight if no flight state is remembered (m).
FLYING_HEIGHT = 0.15
FILTER_LIMIT = 60.0  #: Longest time for which the filter may hold or land the vehicle (s).
ROUNDING = 1e-6  #: Tolerance of comparisons between times (s).

SHORTEST_DESCENT = 1.0  #: Least duration of a descent with a time limit (s).

ARRIVED = 0.3  #: Distance from the hover point of a vehicle that has reached it (m).
#: Time after which one that comes no nearer, by `PROGRESS`, is not waited for (s).
ARRIVAL_TIME = 0.25

#: Reason for which a takeoff or a landing is refused in a flight state.
REFUSALS = {
    None: "the state of the flight is not known yet",
    FlightState.ON_GROUND: "the vehicle is on the ground",
    FlightState.TAKING_OFF: "a takeoff is under way",
    FlightState.FLYING: "the vehicle is in flight; land first",
    FlightState.DESCENDING: "a landing is under way",
    FlightState.LANDING: "a landing is under way",
}


class ServerState(enum.Enum):
    """State of the takeoff server."""

    RECOVERING = 1, None  # Sends nothing until it knows the state of the flight.
    ON_GROUND = 2, FlightState.ON_GROUND  # Repeats zero thrust.
    LIFTING_OFF = 3, FlightState.TAKING_OFF  # Sends the open-loop thrust.
    LIFTED = 10, FlightState.TAKING_OFF  # Climbs slowly, and measures the thrust of hover.
    CLIMBING = 4, FlightState.TAKING_OFF  # The controller flies to the hover point.
    FLYING = 5, FlightState.FLYING
    DESCENDING = 6, FlightState.DESCENDING  # Sends references that sink.
    RAMPING_DOWN = 7, FlightState.LANDING  # Sends a thrust that decreases.
    SINKING_UNSEEN = 11, FlightState.LANDING  # Sends a thrust with which every vehicle sinks.
    TOUCHING_DOWN = 8, FlightState.LANDING  # Repeats zero thrust until the vehicle is down.
    YIELDED = 9, FlightState.LANDING  # The filter brings the vehicle down.

    def __init__(self, _: int, flight_state: FlightState | None):
        #: The flight state that is published meanwhile; None if no state is published.
        self.flight_state = flight_state


class Request(enum.Enum):
    """What the server is asked to do."""

    RECOVER = enum.auto()  # The evidence is complete, or the time for it is over.
    TAKEOFF = enum.auto()  # /takeoff was called, and no check refuses it.
    LAND = enum.auto()  # /land, critical battery, end of the launch, fault in a takeoff.
    END = enum.auto()  # The vehicle cannot fly any more: nothing flies it.
    SINK = enum.auto()  # The vehicle is not seen any more in the open loop of a takeoff.


class FilterReport(NamedTuple):
    """The last status of the filter; what it says is so."""

    state: FilterState = FilterState.PASSING
    remembered: FlightState | None = None  # Flight state that the filter received last.
    is_commanded: bool = True  # Whether a controller sends commands, or may do so.
    reason: str = ""  # Why the filter does not pass controls on.
    refusal: str = ""  # Why it passes no takeoff on.

    @property
    def stops(self) -> bool:
        """Whether the motors are off at once, or it passes no takeoff on."""
        return self.state is FilterState.EMERGENCY or bool(self.refusal)

    @property
    def takes_over(self) -> bool:
        """Whether the filter has the vehicle, or has stopped its motors."""
        return self.state >= FilterState.SINKING or self.stops


NO_FILTER = FilterReport()  #: Before a filter has published anything.


@dataclass(frozen=True)
class Output:
    """Messages to publish after a tick."""

    thrust: float | None = None  # Takeoff control with level attitude (m/s^2).
    reference: tuple[float, ...] | None = None  # x, y, z (m) and x_dot, y_dot, z_dot (m/s).
    hover_thrust: float | None = None  # The thrust of hover that was measured (m/s^2).
    toggle: bool = False  # Whether in_flight changes.


class FlightStateMachine:
    """The vehicle's flight, from the ground to the ground; `TABLE` has its transitions.

    `REQUESTS` are made when they come, `FOLLOWS` when the filter says something, and `PROFILE` in
    time.
    """

    def __init__(self, plan: TakeoffPlan, state: ServerState = ServerState.RECOVERING):
        self.state = state
        self.requested: Request | None = None  #: While it is decided.
        self.plan = plan  #: May be replaced; a takeoff or landing that has begun keeps its plan.
        self.filter = NO_FILTER  #: The last status of the filter.
        self.ground = 0.0  #: Height (z) of the ground where the vehicle took off (m).
        self.ground_is_known = True  # False where the vehicle has sunk further.
        self.time = -math.inf  # Time of the last tick (s).
        self.left_ground = -math.inf  # When the flight began (s).
        self.measured_hover = GRAVITY  # The thrust of hover of the last liftoff, or g (m/s^2).
        self.measured: Position | None = None  # Present position (m); None if it is not known.
        self.z_dot: float | None = None  # Present vertical speed (m/s); None if it is not known.
        self.reference: tuple[float, ...] | None = None  # See `Output`.
        # The last known position, in a descent also by dead reckoning.
        self._position: Position | None = None
        self._in_flight = self._is_in_flight()  # As in_flight has been toggled.
        self._begin()

    def _begin(self):
        self.begun: float | None = None  # Begin of the present state (s); None until the next tick.
        self.descent: Descent | None = None
        self.descent_speed = self.plan.descent_speed  # Planned speed (m/s).
        self.descent_end = math.inf  # Latest end of a descent, s after it began.
        self.ramp_height: float | None = None  # First height measured in the ramp of a landing (m).
        self.zero_sent = -math.inf  # When zero thrust was sent last (s).
        self.lift_off = LiftOff(self.plan.thrust or LIFT_OFF_THRUST)
        self.hover_thrust: float | None = None  # See `Output`.
        # Least distance from the hover point since the takeoff was over (m), and when (s).
        self._nearest = math.inf, -math.inf

    @property
    def flight_state(self) -> FlightState | None:
        """The flight state that is published; None while it is not known."""
        return self.state.flight_state

    @property
    def elapsed(self) -> float:
        """Time since the present state began, s."""
        return 0.0 if self.begun is None else self.time - self.begun

    def set_filter(self, report: FilterReport) -> bool:
        """Set the status of the filter; return whether the state has changed by it."""
        is_late, self.filter = self.filter is NO_FILTER, report
        if is_late and self.state is ServerState.FLYING:
            # The height alone was taken for a flight: a vehicle may stand on a table.
            self.state = ServerState.RECOVERING
            self.recover(self.measured, self.ground)
        return self._judge(FOLLOWS)

    def accepts(self, request: Request) -> bool:
        """Return whether the present state has a transition for a request."""
        self.requested = request
        accepts = first_firing(_in(self.state, REQUESTS), {}, 0.0, None, self) is not None
        self.requested = None
        return accepts

    def request(self, request: Request) -> None:
        """Make the transition of a request; `RefusalError` if the present state has none."""
        self.requested = request
        is_accepted = self._judge(REQUESTS)
        self.requested = None
        if not is_accepted:
            raise RefusalError(REFUSALS[self.flight_state])

    @property
    def yields(self) -> bool:
        """Whether the filter brings the vehicle down."""
        return self.state is ServerState.YIELDED

    def _judge(self, rows, ticks=False):
        """Make the first transition of a table whose guard fires; return whether there is one."""
        found = first_firing(_in(self.state, rows), {}, 0.0, None, self)
        if found is None:
            return False
        before, self.state = self.state, found[0].next
        if before in (ServerState.RECOVERING, ServerState.ON_GROUND):
            self.left_ground = self.time
        if (before, self.state) not in _PARTS and before is not ServerState.RECOVERING:
            self._begin()
            self.begun = self.time if ticks else None
        if self.state is ServerState.CLIMBING:
            self.reference = (*self.plan.hover, 0.0, 0.0, 0.0)
            if before is ServerState.LIFTED:
                self.hover_thrust = self.measured_hover
        elif before is ServerState.RAMPING_DOWN and self.state is ServerState.DESCENDING:
            # It has sunk in the ramp: the ground is lower than where it took off.
            self.ground_is_known = False
            self._plan_descent(is_seen_again=False)
        return True

    def recover(self, position: Position | None, ground: float) -> None:
        """Derive the state from the status of the filter and the measured position (m).

        ``ground`` is the height (z) of the ground that the former server has stored, m. If the
        filter remembers no flight, that may be of another launch, and z = 0 is taken.
        """
        remembered = self.filter.remembered
        self.measured = position
        self.ground = 0.0 if remembered is None else ground
        self.requested = Request.RECOVER
        self._judge(REQUESTS)
        self.requested = None
        self._in_flight = self._is_in_flight() if remembered is None else remembered.in_flight

    def limit_descent(self, duration: float) -> None:
        """Make a descent that is under way end within a time, s."""
        if self.state is ServerState.DESCENDING:
            self.descent_end = self.elapsed + duration
            self.descent = None

    def tick(
        self, time: float, position: Position | None = None, z_dot: float | None = None
    ) -> Output:
        """Advance to ``time`` (s); position and vertical speed (m/s) are measured, or None."""
        step = max(time - self.time, 0.0) if self.begun is not None else 0.0
        self._follow_clock(time)
        is_seen_again = position is not None and self.measured is None
        self.measured, self.z_dot, self.reference = position, z_dot, None
        self.hover_thrust = None
        if self.state in OPEN_LOOP:
            self.lift_off.measure(step, self.z_dot)
        if position is not None:
            self._measure(position)
        if self.state is ServerState.DESCENDING:
            self._plan_descent(is_seen_again)
        while self._judge(FOLLOWS, ticks=True) or self._judge(PROFILE, ticks=True):
            pass
        if self.state is ServerState.LIFTED and self.z_dot is not None:
            self.lift_off.climb(self._distance() or 0.0, self.z_dot)
            self.hover_thrust = self.measured_hover = self.lift_off.hover
        if self.descent is not None:
            self.reference = self.descent.reference(self.elapsed)
            if position is None:
                self._position = self.reference[:3]
        was_in_flight, self._in_flight = self._in_flight, self._is_in_flight()
        toggle = self._in_flight != was_in_flight
        return Output(self._thrust(), self.reference, self.hover_thrust, toggle)

    def arrival(self) -> float | None:
        """Return the distance from the hover point, m, once a takeoff is over; None before that.

        It is over when the vehicle is there, or comes no nearer: its controller may have another
        reference by now.
        """
        distance = 0.0 if self.measured is None else math.dist(self.measured, self.plan.hover)
        nearest, since = self._nearest
        if distance < nearest - PROGRESS:
            self._nearest = distance, self.time
            return distance if distance < ARRIVED else None
        return distance if distance < ARRIVED or self.time - since > ARRIVAL_TIME else None

    def _is_in_flight(self):
        return self.flight_state is not None and self.flight_state.in_flight

    def _measure(self, position):
        self._position = position
        if self.state is ServerState.ON_GROUND:
            self.ground, self.ground_is_known = position[2], True
        elif self.state is ServerState.RAMPING_DOWN and self.ramp_height is None:
            self.ramp_height = position[2]
        elif self.descent is not None:
            self.descent.measure(self.elapsed, position[2])

    def _distance(self):
        """Return the height of the hover point above the vehicle, m, or None."""
        return None if self.measured is None else self.plan.hover[2] - self.measured[2]

    def _plan_descent(self, is_seen_again):
        position, elapsed = self._position, self.elapsed
        waits = self.filter.state is FilterState.HOLDING and elapsed < FILTER_LIMIT
        if position is None or not (self.descent is None or is_seen_again or waits):
            return
        if not self.ground_is_known:
            self.descent = Descent(elapsed, position, None, self.descent_speed)
            return
        remaining = max(self.descent_end - elapsed, SHORTEST_DESCENT)
        speed = max(self.descent_speed, (position[2] - self.ground) / remaining)
        self.descent = Descent(elapsed, position, self.ground, speed)

    def _thrust(self):
        if self.state in OPEN_LOOP:
            # Nothing lifts a vehicle that may be light, and is not seen any more: it is not high.
            may_be_light = self.state is ServerState.LIFTED or not self.lift_off.is_known
            is_pushed = not (self.lift_off.is_lost and may_be_light)
            return self.lift_off.thrust if is_pushed else UNSEEN_THRUST
        if self.hover_thrust is not None:
            # The filter repeats it until the controller has the vehicle.
            return self.hover_thrust
        if self.state is ServerState.SINKING_UNSEEN:
            return UNSEEN_THRUST
        if self.state is ServerState.RAMPING_DOWN and self.begun is not None:
            return self.plan.ramp_thrust(self.elapsed, self.measured_hover)
        if self.state not in (ServerState.ON_GROUND, ServerState.TOUCHING_DOWN):
            return None
        if self.time - self.zero_sent < ZERO_THRUST_PERIOD - ROUNDING:
            return None
        self.zero_sent = self.time
        return 0.0

    def _follow_clock(self, time):
        if self.begun is None:
            self.begun = time
        elif time < self.time:
            self.begun += time - self.time
            self.zero_sent += time - self.time
        self.time = time

    # Guards.

    def _high_and_commanded_but_not_remembered(self):
        is_high = self.measured is not None and self.measured[2] > FLYING_HEIGHT
        return self.filter.remembered is None and is_high and self.filter.is_commanded

    def _no_flight_remembered(self):
        return self.filter.remembered in (None, FlightState.ON_GROUND)

    def _flying_remembered(self):
        return self.filter.remembered is FlightState.FLYING

    def _down(self):
        """Return whether the vehicle is seen as low as the ground from which it took off."""
        return self.measured is not None and self.measured[2] - self.ground < TOUCHDOWN_HEIGHT

    def _down_in_a_takeoff(self):
        # The thrust with which the vehicle hovers is not known: a ramp might lift it.
        return self.filter.remembered is FlightState.TAKING_OFF and self._down()

    def _seen_and_landings_have_a_descent(self):
        return self.measured is not None and self._landings_have_a_descent()

    def _landings_have_a_descent(self):
        return self.plan.descent_speed > 0.0

    def _lifted_off(self):
        distance, z_dot = self._distance(), self.z_dot
        return distance is not None and z_dot is not None and has_lifted_off(distance, z_dot)

    def _open_loop_over(self):
        return self.elapsed + ROUNDING >= self.plan.open_loop and not self.lift_off.is_lost

    def _takeoff_over(self):
        return self.elapsed + ROUNDING >= self.plan.open_loop + self.plan.settle

    def _takeoff_over_but_still_down(self):
        return self._takeoff_over() and self.plan.settle >= LIFT_OFF_TIME and self._down()

    def _down_or_descent_over(self):
        if self.descent is None or self.descent.is_over(self.elapsed):
            return True
        return self.ground_is_known and self._down()

    def _still_sinks(self):
        if self.measured is None or self.ramp_height is None:
            return False
        return self.measured[2] < self.ramp_height - RAMP_DROP and self.descent_speed > 0.0

    def _unseen_for_long_enough(self):
        return self.elapsed + ROUNDING >= UNSEEN_TIME

    def _ramp_over(self):
        return self.elapsed + ROUNDING >= self.plan.ramp

    def _down_or_not_seen_or_too_late(self):
        is_late = self.elapsed + ROUNDING > self.plan.ramp + TOUCHDOWN_LIMIT
        # The motors are off already: without a height there is nothing to wait for.
        return self.measured is None or self._down() or is_late

    def _filter_too_late(self):
        return self.elapsed + ROUNDING >= FILTER_LIMIT


def _in(state, rows):
    return [row for row in rows if state in row.phases]


def _requested(request, guard=None):
    """Return a guard that fires for a request, and if another guard fires, too."""
    return lambda _, flight: flight.requested is request and (guard is None or guard(flight))


def _if(guard):
    """Return a guard of the flight alone."""
    return lambda _, flight: guard(flight)


def _filter(*states):
    return lambda _, flight: flight.filter.state in states


_S, _F, _M = ServerState, FilterState, FlightStateMachine
OPEN_LOOP = (_S.LIFTING_OFF, _S.LIFTED)  #: The parts of a takeoff without the controller.
_TAKEOFF = (*OPEN_LOOP, _S.CLIMBING)
_ALOFT = (_S.FLYING, _S.DESCENDING, _S.RAMPING_DOWN, _S.SINKING_UNSEEN, _S.TOUCHING_DOWN)
FLYING = (*_TAKEOFF, _S.FLYING)  #: The states that a landing ends.
AIRBORNE = (*_TAKEOFF, *_ALOFT, _S.YIELDED)
_BEGIN = (_S.RECOVERING,)
#: Parts of one takeoff or landing, whose times go on.
_PARTS = (
    (_S.LIFTING_OFF, _S.LIFTED),
    (_S.LIFTING_OFF, _S.CLIMBING),
    (_S.LIFTED, _S.CLIMBING),
    (_S.CLIMBING, _S.FLYING),
    (_S.RAMPING_DOWN, _S.TOUCHING_DOWN),
)


def _recover(name, guard, next_state):
    return Guard(name, _BEGIN, _requested(Request.RECOVER, guard), next_state)


REQUESTS: tuple[Guard, ...] = (
    # In doubt the vehicle is flying: the controller keeps it, and the operator can land.
    _recover("filter sinks", lambda m: m.filter.state is _F.SINKING, _S.YIELDED),
    _recover("filter has stopped the motors", lambda m: m.filter.takes_over, _S.ON_GROUND),
    _recover("high and commanded", _M._high_and_commanded_but_not_remembered, _S.FLYING),
    _recover("no flight is remembered", _M._no_flight_remembered, _S.ON_GROUND),
    _recover("flying is remembered", _M._flying_remembered, _S.FLYING),
    # The caller of an interrupted takeoff or landing got an error, and expects safety.
    _recover("has not left", _M._down_in_a_takeoff, _S.TOUCHING_DOWN),
    _recover("is down", _M._down, _S.RAMPING_DOWN),
    _recover("is seen in the air", _M._seen_and_landings_have_a_descent, _S.DESCENDING),
    _recover("is not seen", None, _S.FLYING),
    Guard("takeoff", (_S.ON_GROUND,), _requested(Request.TAKEOFF), _S.LIFTING_OFF),
    Guard("land", FLYING, _requested(Request.LAND, _M._landings_have_a_descent), _S.DESCENDING),
    Guard("land without descent", FLYING, _requested(Request.LAND), _S.RAMPING_DOWN),
    Guard("flight is over", AIRBORNE, _requested(Request.END), _S.ON_GROUND),
    Guard("is not seen", OPEN_LOOP, _requested(Request.SINK), _S.SINKING_UNSEEN),
)

FOLLOWS: tuple[Guard, ...] = (
    Guard("filter stops", AIRBORNE, lambda _, m: m.filter.stops, _S.ON_GROUND),
    Guard("filter sinks", (*_TAKEOFF, *_ALOFT), _filter(_F.SINKING), _S.YIELDED),
    # At the beginning of a takeoff the filter may still be down from the last flight.
    Guard("filter is down", (*_ALOFT, _S.YIELDED), _filter(_F.DOWN), _S.ON_GROUND),
    Guard("filter is new", (_S.YIELDED,), _filter(_F.PASSING, _F.HOLDING), _S.RAMPING_DOWN),
)

PROFILE: tuple[Guard, ...] = (
    Guard("open loop is over", OPEN_LOOP, _if(_M._open_loop_over), _S.CLIMBING),
    Guard("has lifted off", (_S.LIFTING_OFF,), _if(_M._lifted_off), _S.LIFTED),
    Guard("has not left", (_S.CLIMBING,), _if(_M._takeoff_over_but_still_down), _S.RAMPING_DOWN),
    Guard("takeoff is over", (_S.CLIMBING,), _if(_M._takeoff_over), _S.FLYING),
    Guard("is down", (_S.DESCENDING,), _if(_M._down_or_descent_over), _S.RAMPING_DOWN),
    # The ground may be lower than at the takeoff, for example next to a table.
    Guard("still sinks", (_S.RAMPING_DOWN,), _if(_M._still_sinks), _S.DESCENDING),
    Guard("ramp is over", (_S.RAMPING_DOWN,), _if(_M._ramp_over), _S.TOUCHING_DOWN),
    Guard("is down unseen", (_S.SINKING_UNSEEN,), _if(_M._unseen_for_long_enough), _S.ON_GROUND),
    Guard("touchdown", (_S.TOUCHING_DOWN,), _if(_M._down_or_not_seen_or_too_late), _S.ON_GROUND),
    Guard("filter is too late", (_S.YIELDED,), _if(_M._filter_too_late), _S.ON_GROUND),
)

TABLE = (*REQUESTS, *FOLLOWS, *PROFILE)
