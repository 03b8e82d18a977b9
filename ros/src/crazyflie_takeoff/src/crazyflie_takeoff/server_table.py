"""Takeoff and landing: the server's states, the table of their transitions, and its machine.

Heights and positions are in the fixed frame (z up), m. Times are s of any clock that does not run
backwards; if it is reset, what was under way goes on from there.
"""

import enum
import math
from dataclasses import dataclass
from typing import NamedTuple

from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.flight_state import FlightState
from crazyflie_takeoff.motion import TOUCHDOWN_HEIGHT, Position
from crazyflie_takeoff.transition_table import Table, Transition, find, step
from crazyflie_utils.refusal import RefusalError

LIFT_OFF_THRUST = GRAVITY + 0.2  #: Thrust of the open-loop part of a takeoff, m/s^2.
LIFT_OFF_TIME = 3.0  #: A vehicle that a controller has not lifted off in this time, s, cannot fly.
RAMP_DURATION = 1.0  #: How long the thrust of a landing goes down, s; zero thrust follows.
#: A vehicle that sinks by more than this in the ramp of a landing was not on the ground, m.
RAMP_DROP = 0.1
TOUCHDOWN_LIMIT = 2.0  #: How long after the ramp a vehicle may take to come down, s.
#: A vehicle above this height is in flight if no flight state is remembered, m.
FLYING_HEIGHT = 0.15
FILTER_LIMIT = 60.0  #: How long the filter may take to bring a vehicle down, or hold it, s.
ROUNDING = 1e-6  #: Tolerance of comparisons between times, s.
RAMP_RATE = 5.0  #: How fast the thrust of a landing goes down from hover, m/s^2 per s.
ZERO_THRUST_PERIOD = 0.1  #: Period at which zero thrust is repeated on the ground, s.
#: A descent that has to end within a time takes at least this, s, however late it is.
SHORTEST_DESCENT = 1.0

DESCENT_MARGIN = 3.0  #: How much longer than calculated a descent may take, s.

#: A vehicle that does not sink for this long in a descent to an unknown ground is on it, s. It is
#: longer than the filter takes to notice a controller that does not follow (`DESCENT_TIMEOUT`).
STOP_TIME = 2.0
PROGRESS = 0.02  #: Less than this below where it was lowest, m, a vehicle does not sink.
SEARCH_LIMIT = 20.0  #: Longest descent to an unknown ground, s.

#: How far below the ground a descent's reference goes, m, so that the vehicle meets the ground with
#: its speed also when it hangs above the reference.
PRESS_DEPTH = 0.3

#: Why a takeoff or a landing is refused.
REFUSALS = {
    None: "the state of the flight is not known yet",
    FlightState.ON_GROUND: "the vehicle is on the ground",
    FlightState.TAKING_OFF: "a takeoff is under way",
    FlightState.FLYING: "the vehicle is in flight; land first",
    FlightState.DESCENDING: "a landing is under way",
    FlightState.LANDING: "a landing is under way",
}


class ServerState(enum.Enum):
    """What the server does."""

    RECOVERING = enum.auto()  # Sends nothing until it knows the state of the flight.
    ON_GROUND = enum.auto()  # Repeats zero thrust.
    LIFTING_OFF = enum.auto()  # Sends the open-loop thrust.
    CLIMBING = enum.auto()  # The controller flies to the hover point.
    FLYING = enum.auto()
    DESCENDING = enum.auto()  # Sends references that sink.
    RAMPING_DOWN = enum.auto()  # Sends a thrust that decreases.
    TOUCHING_DOWN = enum.auto()  # Repeats zero thrust until the vehicle is on the ground.
    YIELDED = enum.auto()  # The filter brings the vehicle down.

    @property
    def flight_state(self) -> FlightState | None:
        """What is published meanwhile; None for nothing."""
        return _FLIGHT_STATES.get(self)


_FLIGHT_STATES = {
    ServerState.ON_GROUND: FlightState.ON_GROUND,
    ServerState.LIFTING_OFF: FlightState.TAKING_OFF,
    ServerState.CLIMBING: FlightState.TAKING_OFF,
    ServerState.FLYING: FlightState.FLYING,
    ServerState.DESCENDING: FlightState.DESCENDING,
    ServerState.RAMPING_DOWN: FlightState.LANDING,
    ServerState.TOUCHING_DOWN: FlightState.LANDING,
    ServerState.YIELDED: FlightState.LANDING,
}


class Event(enum.Enum):
    """What can change the state of the server."""

    RECOVER = enum.auto()  # All evidence has come, or the time for it is over.
    TAKEOFF = enum.auto()  # The service was called, and no check refuses it.
    LAND = enum.auto()  # Service, critical battery, end of the launch, fault in a takeoff.
    TICK = enum.auto()  # Time has passed.
    FILTER_PASSES = enum.auto()
    FILTER_HOLDS = enum.auto()  # It keeps the vehicle in place until a control comes back.
    FILTER_SINKS = enum.auto()  # It brings the vehicle down.
    FILTER_DOWN = enum.auto()  # It has brought the vehicle down; motors off.
    FILTER_EMERGENCY = enum.auto()  # It has stopped the motors at once.
    FILTER_REFUSES = enum.auto()  # It keeps the motors off and passes no takeoff on.


STOPS = (Event.FILTER_EMERGENCY, Event.FILTER_REFUSES)
#: With these the filter has the vehicle.
TAKEOVERS = (Event.FILTER_SINKS, Event.FILTER_DOWN, *STOPS)


class FilterReport(NamedTuple):
    """What the filter has published last."""

    event: Event = Event.FILTER_PASSES
    remembered: FlightState | None = None  # Flight state that it received last.
    is_commanded: bool = True  # Whether a controller sends commands, or may do so.
    reason: str = ""  # Why it does not pass controls on, or refuses takeoffs.


NO_FILTER = FilterReport()  #: Before a filter has published anything.


class Descent:
    """A reference that sinks at a constant speed (m/s) to the ground (z, m).

    Times are s since the landing began; at ``begin`` it is at ``position`` (m). To an unknown
    ground (``None``) it sinks without end, until the vehicle does not follow any more.
    """

    def __init__(self, begin: float, position: Position, ground: float | None, speed: float):
        self._begin = begin
        self._x, self._y, self._z = position
        self._speed = speed
        self._seen: tuple[float, float] | None = None
        if ground is None:
            self._lowest, self._end = -math.inf, begin + SEARCH_LIMIT
        else:
            self._lowest = min(ground - PRESS_DEPTH, self._z)
            self._end = begin + max(self._z - ground, 0.0) / speed + DESCENT_MARGIN

    def follow(self, time: float, z: float) -> bool:
        """Take a measured height (m); return whether it has not sunk for `STOP_TIME`."""
        if self._seen is None or z < self._seen[0] - PROGRESS:
            self._seen = z, time
        return time - self._seen[1] > STOP_TIME

    def is_over(self, time: float) -> bool:
        """Return whether a vehicle that follows has been on the ground for `DESCENT_MARGIN`."""
        return time > self._end

    def reference(self, time: float) -> tuple[float, float, float, float, float, float]:
        """Return x, y, z in m and x_dot, y_dot, z_dot in m/s."""
        z = self._z - self._speed * (time - self._begin)
        if z <= self._lowest:
            return (self._x, self._y, self._lowest, 0.0, 0.0, 0.0)
        return (self._x, self._y, z, 0.0, 0.0, -self._speed)


@dataclass(frozen=True)
class Plan:
    """How to take off and land."""

    hover: Position
    open_loop: float  # How long `LIFT_OFF_THRUST` is given, s.
    settle: float  # How long the controller has to reach the hover point, s.
    descent_speed: float  # m/s; 0 for no descent: a landing is the bare ramp.


@dataclass
class FlightContext:
    """What the guards read, and the actions change."""

    plan: Plan  # Replaced at any time; what has begun goes on as it was planned.
    filter: FilterReport = NO_FILTER
    ground: float = 0.0  # Height (z) of the ground, where the vehicle was last on it, m.
    # Whether it is below the vehicle: not where this sank past it beside a table.
    ground_is_below: bool = True
    time: float = -math.inf  # Of the latest tick, s.
    begun: float | None = None  # When the present activity began, s; None until the next tick.
    measured: Position | None = None  # None when it is not known at present.
    reference: tuple[float, ...] | None = None  # To publish: x, y, z, m, x_dot, y_dot, z_dot, m/s.
    descent: Descent | None = None
    ramp_height: float | None = None  # The first that was measured in the ramp of a landing, m.
    descent_speed: float = 0.0  # Of the plan, when the activity began, m/s.
    descent_end: float = math.inf  # When a descent has to be over, s after it began.
    zero_sent: float = -math.inf  # When zero thrust was sent last, s.

    @property
    def elapsed(self) -> float:
        """Time since the present activity began, s."""
        return 0.0 if self.begun is None else self.time - self.begun

    @property
    def is_down(self) -> bool:
        """Whether the vehicle is seen as low as the ground from which it took off."""
        return self.measured is not None and self.measured[2] - self.ground < TOUCHDOWN_HEIGHT


# Actions.


def _begin(flight):
    flight.begun = flight.descent = flight.ramp_height = None
    flight.descent_speed = flight.plan.descent_speed
    flight.descent_end = math.inf
    flight.zero_sent = -math.inf


def _begin_at_once(flight):
    _begin(flight)
    flight.begun = flight.time


def _descend_further(flight):
    _begin_at_once(flight)
    flight.ground_is_below = False
    flight.descent = Descent(0.0, flight.measured, None, flight.descent_speed)


def _send_hover_point(flight):
    flight.reference = (*flight.plan.hover, 0.0, 0.0, 0.0)


# Guards.


def _filter_sinks(flight):
    return flight.filter.event is Event.FILTER_SINKS


def _filter_has_stopped_motors(flight):
    return flight.filter.event in (Event.FILTER_DOWN, *STOPS)


def _high_and_commanded_but_not_remembered(flight):
    is_high = flight.measured is not None and flight.measured[2] > FLYING_HEIGHT
    return flight.filter.remembered is None and is_high and flight.filter.is_commanded


def _no_flight_remembered(flight):
    return flight.filter.remembered in (None, FlightState.ON_GROUND)


def _flying_remembered(flight):
    return flight.filter.remembered is FlightState.FLYING


def _down(flight):
    return flight.is_down


def _seen_and_landings_have_a_descent(flight):
    return flight.measured is not None and _landings_have_a_descent(flight)


def _landings_have_a_descent(flight):
    return flight.plan.descent_speed > 0.0


def _open_loop_over(flight):
    return flight.elapsed + ROUNDING >= flight.plan.open_loop


def _takeoff_over(flight):
    return flight.elapsed + ROUNDING >= flight.plan.open_loop + flight.plan.settle


def _takeoff_over_but_still_down(flight):
    return _takeoff_over(flight) and flight.plan.settle >= LIFT_OFF_TIME and flight.is_down


def _down_or_descent_over(flight):
    descent = flight.descent
    if descent is None or descent.is_over(flight.elapsed):
        return True
    if flight.ground_is_below or flight.measured is None:
        return flight.is_down
    return descent.follow(flight.elapsed, flight.measured[2])


def _still_sinks(flight):
    is_known = flight.measured is not None and flight.ramp_height is not None
    drops = is_known and flight.measured[2] < flight.ramp_height - RAMP_DROP
    return drops and flight.descent_speed > 0.0


def _ramp_over(flight):
    return flight.elapsed + ROUNDING >= RAMP_DURATION


def _down_or_not_seen_or_too_late(flight):
    is_late = flight.elapsed + ROUNDING > RAMP_DURATION + TOUCHDOWN_LIMIT
    # The motors are off already: without a height there is nothing to wait for.
    return flight.measured is None or flight.is_down or is_late


def _filter_too_late(flight):
    return flight.elapsed + ROUNDING >= FILTER_LIMIT


_S, _E = ServerState, Event
_TAKEOFF = (_S.LIFTING_OFF, _S.CLIMBING)
_AIRBORNE_OR_LANDING = (_S.FLYING, _S.DESCENDING, _S.RAMPING_DOWN, _S.TOUCHING_DOWN)

TABLE: Table[ServerState, FlightContext] = (
    # In doubt the vehicle is flying: the controller keeps it, and the operator can land.
    Transition(_S.RECOVERING, _E.RECOVER, _filter_sinks, _S.YIELDED),
    Transition(_S.RECOVERING, _E.RECOVER, _filter_has_stopped_motors, _S.ON_GROUND),
    Transition(_S.RECOVERING, _E.RECOVER, _high_and_commanded_but_not_remembered, _S.FLYING),
    Transition(_S.RECOVERING, _E.RECOVER, _no_flight_remembered, _S.ON_GROUND),
    Transition(_S.RECOVERING, _E.RECOVER, _flying_remembered, _S.FLYING),
    # The caller of an interrupted takeoff or landing, who got an error, expects safety.
    Transition(_S.RECOVERING, _E.RECOVER, _down, _S.RAMPING_DOWN, _begin),
    Transition(_S.RECOVERING, _E.RECOVER, _seen_and_landings_have_a_descent, _S.DESCENDING, _begin),
    Transition(_S.RECOVERING, _E.RECOVER, None, _S.FLYING),
    Transition(_S.ON_GROUND, _E.TAKEOFF, None, _S.LIFTING_OFF, _begin),
    Transition(_S.LIFTING_OFF, _E.TICK, _open_loop_over, _S.CLIMBING, _send_hover_point),
    Transition(_S.CLIMBING, _E.TICK, _takeoff_over_but_still_down, _S.RAMPING_DOWN, _begin),
    Transition(_S.CLIMBING, _E.TICK, _takeoff_over, _S.FLYING),
    *(
        row
        for state in (*_TAKEOFF, _S.FLYING)
        for row in (
            Transition(state, _E.LAND, _landings_have_a_descent, _S.DESCENDING, _begin),
            Transition(state, _E.LAND, None, _S.RAMPING_DOWN, _begin),
        )
    ),
    Transition(_S.DESCENDING, _E.TICK, _down_or_descent_over, _S.RAMPING_DOWN, _begin_at_once),
    # The height of the ground is that of the place where the vehicle took off, such as a table.
    Transition(_S.RAMPING_DOWN, _E.TICK, _still_sinks, _S.DESCENDING, _descend_further),
    Transition(_S.RAMPING_DOWN, _E.TICK, _ramp_over, _S.TOUCHING_DOWN),
    Transition(_S.TOUCHING_DOWN, _E.TICK, _down_or_not_seen_or_too_late, _S.ON_GROUND, _begin),
    *(
        Transition(state, _E.FILTER_SINKS, None, _S.YIELDED, _begin)
        for state in (*_TAKEOFF, *_AIRBORNE_OR_LANDING)
    ),
    Transition(_S.YIELDED, _E.FILTER_SINKS, None, _S.YIELDED),
    Transition(_S.YIELDED, _E.FILTER_PASSES, None, _S.RAMPING_DOWN, _begin),
    Transition(_S.YIELDED, _E.FILTER_HOLDS, None, _S.RAMPING_DOWN, _begin),
    Transition(_S.YIELDED, _E.TICK, _filter_too_late, _S.ON_GROUND, _begin),
    # In a takeoff the filter may not have seen it yet, and still be down from the last flight.
    *(
        Transition(state, _E.FILTER_DOWN, None, _S.ON_GROUND, _begin)
        for state in (*_AIRBORNE_OR_LANDING, _S.YIELDED)
    ),
    *(
        Transition(state, event, None, _S.ON_GROUND, _begin)
        for state in (*_TAKEOFF, *_AIRBORNE_OR_LANDING, _S.YIELDED)
        for event in STOPS
    ),
)


@dataclass(frozen=True)
class Output:
    """What is to be published after a tick."""

    thrust: float | None = None  # Takeoff control with level attitude, m/s^2.
    reference: tuple[float, ...] | None = None  # x, y, z, m, and x_dot, y_dot, z_dot, m/s.
    toggle: bool = False  # Whether in_flight changes.


class FlightStateMachine:
    """The vehicle's flight, from the ground to the ground."""

    def __init__(self, plan: Plan, state: ServerState = ServerState.RECOVERING):
        self.state = state
        self._context = FlightContext(plan)
        # The last known position, in a descent also by dead reckoning.
        self._position: Position | None = None
        # As in_flight has been toggled.
        self._in_flight = self._is_in_flight()

    @property
    def flight_state(self) -> FlightState | None:
        """What is published of the state; None while it is not known."""
        return self.state.flight_state

    @property
    def filter(self) -> FilterReport:
        """What the filter has published last."""
        return self._context.filter

    @property
    def ground(self) -> float:
        """Height (z) of the ground, where the vehicle was last seen on it, m."""
        return self._context.ground

    def set_plan(self, plan: Plan) -> None:
        """Take another plan; what has begun already goes on as it was planned."""
        self._context.plan = plan

    def set_filter(self, report: FilterReport) -> None:
        """Take what the filter has published."""
        self._context.filter = report
        self.handle(report.event)

    def accepts(self, event: Event) -> bool:
        """Return whether the present state has a transition for an event."""
        return find(TABLE, self.state, event, self._context) is not None

    def handle(self, event: Event) -> None:
        """Take the transition of an event, if the present state has one."""
        self.state = step(TABLE, self.state, event, self._context)

    def request(self, event: Event) -> None:
        """Take the transition of an event; `RefusalError` if the present state has none."""
        if not self.accepts(event):
            raise RefusalError(REFUSALS[self.flight_state])
        self.handle(event)

    def recover(self, position: Position | None, ground: float) -> None:
        """Conclude the state of the flight from the filter's report and the measured position (m).

        ``ground`` is the height (z) of the ground that the former server has noted, m. If the
        filter remembers no flight, it may be of another launch, and the ground is taken to be at z
        = 0.
        """
        remembered = self.filter.remembered
        self._context.measured = position
        self._context.ground = 0.0 if remembered is None else ground
        self.handle(Event.RECOVER)
        self._in_flight = self._is_in_flight() if remembered is None else remembered.in_flight

    def limit_descent(self, duration: float) -> None:
        """Make a descent that is under way end within a time, s."""
        if self.state is ServerState.DESCENDING:
            self._context.descent_end = self._context.elapsed + duration
            self._context.descent = None

    def tick(self, time: float, position: Position | None = None) -> Output:
        """Let time pass until ``time`` (s); the measured position is None when it is not known."""
        context = self._context
        self._follow_clock(time)
        is_seen_again = position is not None and context.measured is None
        context.measured, context.reference = position, None
        if position is not None:
            self._position = position
            if self.state is ServerState.ON_GROUND:
                context.ground, context.ground_is_below = position[2], True
            if self.state is ServerState.RAMPING_DOWN and context.ramp_height is None:
                context.ramp_height = position[2]
        if self.state is ServerState.DESCENDING:
            self._plan_descent(is_seen_again)
        while self.accepts(Event.TICK):
            self.handle(Event.TICK)
        if context.descent is not None:
            context.reference = context.descent.reference(context.elapsed)
            if position is None:
                self._position = context.reference[:3]
        was_in_flight, self._in_flight = self._in_flight, self._is_in_flight()
        return Output(self._thrust(), context.reference, self._in_flight != was_in_flight)

    def _is_in_flight(self):
        return self.flight_state is not None and self.flight_state.in_flight

    def _plan_descent(self, is_seen_again):
        context, position = self._context, self._position
        waits = context.filter.event is Event.FILTER_HOLDS and context.elapsed < FILTER_LIMIT
        if position is None or not (context.descent is None or is_seen_again or waits):
            return
        if context.ground_is_below:
            remaining = max(context.descent_end - context.elapsed, SHORTEST_DESCENT)
            speed = max(context.descent_speed, (position[2] - context.ground) / remaining)
            context.descent = Descent(context.elapsed, position, context.ground, speed)
        else:
            context.descent = Descent(context.elapsed, position, None, context.descent_speed)

    def _thrust(self):
        context = self._context
        if self.state is ServerState.LIFTING_OFF:
            return LIFT_OFF_THRUST
        if self.state is ServerState.RAMPING_DOWN and context.begun is not None:
            return GRAVITY - RAMP_RATE * context.elapsed
        if self.state not in (ServerState.ON_GROUND, ServerState.TOUCHING_DOWN):
            return None
        if context.time - context.zero_sent < ZERO_THRUST_PERIOD - ROUNDING:
            return None
        context.zero_sent = context.time
        return 0.0

    def _follow_clock(self, time):
        context = self._context
        if context.begun is None:
            context.begun = time
        elif time < context.time:
            context.begun += time - context.time
            context.zero_sent += time - context.time
        context.time = time
