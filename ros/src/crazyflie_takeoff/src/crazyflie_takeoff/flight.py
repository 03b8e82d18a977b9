"""Takeoff and landing: steps `server_table.TABLE`, and makes thrust and references.

Heights and positions are in the fixed frame (z up), m. Times are s of any clock
that does not run backwards; if it is reset, what was under way goes on from there.
"""

from dataclasses import dataclass

from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.descent import Descent
from crazyflie_takeoff.flight_state import FlightState
from crazyflie_takeoff.motion import Position
from crazyflie_takeoff.server_states import Event, FilterReport, ServerState
from crazyflie_takeoff.server_table import (
    FILTER_LIMIT,
    LIFT_OFF_THRUST,
    ROUNDING,
    TABLE,
    FlightContext,
    Plan,
)
from crazyflie_takeoff.transition_table import find, step
from crazyflie_utils.refusal import RefusalError

RAMP_RATE = 5.0  #: How fast the thrust of a landing goes down from hover, m/s^2 per s.
ZERO_THRUST_PERIOD = 0.1  #: Period at which zero thrust is repeated on the ground, s.
#: A descent that has to end within a time takes at least this, s, however late it is.
SHORTEST_DESCENT = 1.0

#: Why a takeoff or a landing is refused.
REFUSALS = {
    None: "the state of the flight is not known yet",
    FlightState.ON_GROUND: "the vehicle is on the ground",
    FlightState.TAKING_OFF: "a takeoff is under way",
    FlightState.FLYING: "the vehicle is in flight; land first",
    FlightState.DESCENDING: "a landing is under way",
    FlightState.LANDING: "a landing is under way",
}


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
