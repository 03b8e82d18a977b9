"""Takeoff and landing: the states of the server, their transitions, and the machine.

Heights and positions are in the fixed frame (z up), m. Times are s of any clock that does not run
backwards; if it is reset, a takeoff or a landing continues from there.
"""

import enum
import math
from dataclasses import dataclass
from typing import NamedTuple

from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.lift_off import LiftOff, has_lifted_off
from crazyflie_takeoff.motion import TOUCHDOWN_HEIGHT, Position
from crazyflie_takeoff.transition_table import FlightState, Table, Transition, find, step
from crazyflie_utils.refusal import RefusalError

#: Time after which a vehicle that is still on the ground is unable to fly (s).
LIFT_OFF_TIME = 3.0
RAMP_DURATION = 1.0  #: Duration of the thrust ramp of a landing; zero thrust follows (s).
RAMP_RATE = 5.0  #: Decrease of the thrust in that ramp, which begins at g (m/s^2 per s).
RAMP_DROP = 0.1  #: A vehicle that sinks further in the ramp was not on the ground (m).
TOUCHDOWN_LIMIT = 2.0  #: Longest time from the end of the ramp to the touchdown (s).
ZERO_THRUST_PERIOD = 0.1  #: Period of zero thrust on the ground (s).
#: Height above which a vehicle is in flight if no flight state is remembered (m).
FLYING_HEIGHT = 0.15
FILTER_LIMIT = 60.0  #: Longest time for which the filter may hold or land the vehicle (s).
ROUNDING = 1e-6  #: Tolerance of comparisons between times (s).

SHORTEST_DESCENT = 1.0  #: Least duration of a descent with a time limit (s).
DESCENT_MARGIN = 3.0  #: Time that a descent may take beyond its calculated duration (s).
#: Depth of the last reference of a descent below the ground (m): the vehicle meets the ground with
#: its speed also when it hangs above the reference.
PRESS_DEPTH = 0.3
#: In a descent to an unknown ground, a vehicle that has not sunk for this time is down (s). The
#: filter notices a controller that does not follow sooner (`DESCENT_TIMEOUT`).
STOP_TIME = 2.0
PROGRESS = 0.02  #: Least decrease of the height of a vehicle that sinks (m).
SEARCH_LIMIT = 20.0  #: Longest descent to an unknown ground (s).

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
    TOUCHING_DOWN = 8, FlightState.LANDING  # Repeats zero thrust until the vehicle is down.
    YIELDED = 9, FlightState.LANDING  # The filter brings the vehicle down.

    def __init__(self, _: int, flight_state: FlightState | None):
        #: The flight state that is published meanwhile; None if no state is published.
        self.flight_state = flight_state


class ServerEvent(enum.Enum):
    """Event that can change the state of the server."""

    RECOVER = enum.auto()  # The evidence is complete, or the time for it is over.
    TAKEOFF = enum.auto()  # /takeoff was called, and no check refuses it.
    LAND = enum.auto()  # /land, critical battery, end of the launch, fault in a takeoff.
    TICK = enum.auto()  # Time has passed.
    FILTER_PASSES = enum.auto()  # The filter passes controls on.
    FILTER_HOLDS = enum.auto()  # It keeps the vehicle in place until a control comes back.
    FILTER_SINKS = enum.auto()  # It brings the vehicle down.
    FILTER_DOWN = enum.auto()  # It has brought the vehicle down; the motors are off.
    FILTER_EMERGENCY = enum.auto()  # It has stopped the motors at once.
    FILTER_REFUSES = enum.auto()  # It keeps the motors off and passes no takeoff on.
    VEHICLE_LOST = enum.auto()  # The vehicle has not been able to fly for a while.


#: Events after which the motors are off, and those after which the filter has the vehicle.
STOPS = (ServerEvent.FILTER_EMERGENCY, ServerEvent.FILTER_REFUSES)
TAKEOVERS = (ServerEvent.FILTER_SINKS, ServerEvent.FILTER_DOWN, *STOPS)


class FilterReport(NamedTuple):
    """The last status of the filter."""

    event: ServerEvent = ServerEvent.FILTER_PASSES
    remembered: FlightState | None = None  # Flight state that the filter received last.
    is_commanded: bool = True  # Whether a controller sends commands, or may do so.
    reason: str = ""  # Why the filter does not pass controls on, or refuses takeoffs.


NO_FILTER = FilterReport()  #: Before a filter has published anything.


class Descent:
    """A reference that sinks at a constant speed (m/s) to the ground (z, m).

    Times are s since the landing began; at ``begin`` it is at ``position`` (m). With an unknown
    ground (None) it sinks until the vehicle does not follow any more.
    """

    def __init__(self, begin: float, position: Position, ground: float | None, speed: float):
        self._begin = begin
        self._x, self._y, self._z = position
        self._speed = speed
        self._is_search = ground is None
        # The lowest height that was measured (m), and when (s).
        self._reached = (self._z, begin)
        if ground is None:
            self._lowest, self._end = -math.inf, begin + SEARCH_LIMIT
        else:
            self._lowest = min(ground - PRESS_DEPTH, self._z)
            self._end = begin + max(self._z - ground, 0.0) / speed + DESCENT_MARGIN

    def measure(self, time: float, z: float) -> None:
        """Record a measured height of the vehicle (m)."""
        if z < self._reached[0] - PROGRESS:
            self._reached = z, time

    def is_over(self, time: float) -> bool:
        """Return whether a vehicle that follows is on the ground."""
        has_stopped = self._is_search and time - self._reached[1] > STOP_TIME
        return has_stopped or time > self._end

    def reference(self, time: float) -> tuple[float, float, float, float, float, float]:
        """Return x, y, z in m and x_dot, y_dot, z_dot in m/s."""
        z = self._z - self._speed * (time - self._begin)
        if z <= self._lowest:
            return (self._x, self._y, self._lowest, 0.0, 0.0, 0.0)
        return (self._x, self._y, z, 0.0, 0.0, -self._speed)


@dataclass(frozen=True)
class TakeoffPlan:
    """Durations and speed of takeoffs and landings."""

    hover: Position
    open_loop: float  # Duration of `LIFT_OFF_THRUST` (s).
    settle: float  # Time for the controller to reach the hover point (s).
    descent_speed: float  # m/s; 0 for a landing without a descent, by the ramp alone.


@dataclass(frozen=True)
class Output:
    """Messages to publish after a tick."""

    thrust: float | None = None  # Takeoff control with level attitude (m/s^2).
    reference: tuple[float, ...] | None = None  # x, y, z (m) and x_dot, y_dot, z_dot (m/s).
    hover_thrust: float | None = None  # The thrust of hover that was measured (m/s^2).
    toggle: bool = False  # Whether in_flight changes.


class FlightStateMachine:
    """The vehicle's flight, from the ground to the ground; `TABLE` has its transitions."""

    def __init__(self, plan: TakeoffPlan, state: ServerState = ServerState.RECOVERING):
        self.state = state
        self.plan = plan  #: May be replaced; a takeoff or landing that has begun keeps its plan.
        self.filter = NO_FILTER  #: The last status of the filter.
        self.ground = 0.0  #: Height (z) of the ground where the vehicle took off (m).
        self.ground_is_known = True  # False where the vehicle has sunk further.
        self.time = -math.inf  # Time of the last tick (s).
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
        self.lift_off = LiftOff()
        self.hover_thrust: float | None = None  # See `Output`.

    @property
    def flight_state(self) -> FlightState | None:
        """The flight state that is published; None while it is not known."""
        return self.state.flight_state

    @property
    def elapsed(self) -> float:
        """Time since the present state began, s."""
        return 0.0 if self.begun is None else self.time - self.begun

    def set_filter(self, report: FilterReport) -> None:
        """Set the status of the filter."""
        self.filter = report
        self.handle(report.event)

    def accepts(self, event: ServerEvent) -> bool:
        """Return whether the present state has a transition for an event."""
        return find(TABLE, self.state, event, self) is not None

    def handle(self, event: ServerEvent) -> None:
        """Make the transition of an event, if the present state has one."""
        self.state = step(TABLE, self.state, event, self)

    def request(self, event: ServerEvent) -> None:
        """Make the transition of an event; `RefusalError` if the present state has none."""
        if not self.accepts(event):
            raise RefusalError(REFUSALS[self.flight_state])
        self.handle(event)

    def recover(self, position: Position | None, ground: float) -> None:
        """Derive the state from the status of the filter and the measured position (m).

        ``ground`` is the height (z) of the ground that the former server has stored, m. If the
        filter remembers no flight, that may be of another launch, and z = 0 is taken.
        """
        remembered = self.filter.remembered
        self.measured = position
        self.ground = 0.0 if remembered is None else ground
        self.handle(ServerEvent.RECOVER)
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
        if self.state in (ServerState.LIFTING_OFF, ServerState.LIFTED):
            self.lift_off.measure(step, self.z_dot)
        if position is not None:
            self._measure(position)
        if self.state is ServerState.DESCENDING:
            self._plan_descent(is_seen_again)
        while self.accepts(ServerEvent.TICK):
            self.handle(ServerEvent.TICK)
        if self.state is ServerState.LIFTED:
            self.lift_off.climb(self._distance() or 0.0, self.z_dot)
        if self.descent is not None:
            self.reference = self.descent.reference(self.elapsed)
            if position is None:
                self._position = self.reference[:3]
        was_in_flight, self._in_flight = self._in_flight, self._is_in_flight()
        toggle = self._in_flight != was_in_flight
        return Output(self._thrust(), self.reference, self.hover_thrust, toggle)

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
        waits = self.filter.event is ServerEvent.FILTER_HOLDS and elapsed < FILTER_LIMIT
        if position is None or not (self.descent is None or is_seen_again or waits):
            return
        if not self.ground_is_known:
            self.descent = Descent(elapsed, position, None, self.descent_speed)
            return
        remaining = max(self.descent_end - elapsed, SHORTEST_DESCENT)
        speed = max(self.descent_speed, (position[2] - self.ground) / remaining)
        self.descent = Descent(elapsed, position, self.ground, speed)

    def _thrust(self):
        if self.state in (ServerState.LIFTING_OFF, ServerState.LIFTED):
            return self.lift_off.thrust
        if self.hover_thrust is not None:
            # The filter repeats it until the controller has the vehicle.
            return self.hover_thrust
        if self.state is ServerState.RAMPING_DOWN and self.begun is not None:
            return GRAVITY - RAMP_RATE * self.elapsed
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

    # Actions.

    def _begin_at_once(self):
        self._begin()
        self.begun = self.time

    def _descend_further(self):
        self._begin_at_once()
        self.ground_is_known = False
        self._plan_descent(is_seen_again=False)

    def _send_hover_point(self):
        self.reference = (*self.plan.hover, 0.0, 0.0, 0.0)

    def _send_hover_point_and_thrust(self):
        self._send_hover_point()
        self.hover_thrust = self.lift_off.hover

    # Guards.

    def _filter_sinks(self):
        return self.filter.event is ServerEvent.FILTER_SINKS

    def _filter_has_stopped_motors(self):
        return self.filter.event in (ServerEvent.FILTER_DOWN, *STOPS)

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

    def _seen_and_landings_have_a_descent(self):
        return self.measured is not None and self._landings_have_a_descent()

    def _landings_have_a_descent(self):
        return self.plan.descent_speed > 0.0

    def _lifted_off(self):
        distance, z_dot = self._distance(), self.z_dot
        return distance is not None and z_dot is not None and has_lifted_off(distance, z_dot)

    def _open_loop_over(self):
        return self.elapsed + ROUNDING >= self.plan.open_loop

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

    def _ramp_over(self):
        return self.elapsed + ROUNDING >= RAMP_DURATION

    def _down_or_not_seen_or_too_late(self):
        is_late = self.elapsed + ROUNDING > RAMP_DURATION + TOUCHDOWN_LIMIT
        # The motors are off already: without a height there is nothing to wait for.
        return self.measured is None or self._down() or is_late

    def _filter_too_late(self):
        return self.elapsed + ROUNDING >= FILTER_LIMIT


_S, _E, _M = ServerState, ServerEvent, FlightStateMachine
_TAKEOFF = (_S.LIFTING_OFF, _S.LIFTED, _S.CLIMBING)
_AIRBORNE_OR_LANDING = (_S.FLYING, _S.DESCENDING, _S.RAMPING_DOWN, _S.TOUCHING_DOWN)

TABLE: Table[ServerState, FlightStateMachine] = (
    # In doubt the vehicle is flying: the controller keeps it, and the operator can land.
    Transition(_S.RECOVERING, _E.RECOVER, _M._filter_sinks, _S.YIELDED),
    Transition(_S.RECOVERING, _E.RECOVER, _M._filter_has_stopped_motors, _S.ON_GROUND),
    Transition(_S.RECOVERING, _E.RECOVER, _M._high_and_commanded_but_not_remembered, _S.FLYING),
    Transition(_S.RECOVERING, _E.RECOVER, _M._no_flight_remembered, _S.ON_GROUND),
    Transition(_S.RECOVERING, _E.RECOVER, _M._flying_remembered, _S.FLYING),
    # The caller of an interrupted takeoff or landing got an error, and expects safety.
    Transition(_S.RECOVERING, _E.RECOVER, _M._down, _S.RAMPING_DOWN, _M._begin),
    Transition(
        _S.RECOVERING, _E.RECOVER, _M._seen_and_landings_have_a_descent, _S.DESCENDING, _M._begin
    ),
    Transition(_S.RECOVERING, _E.RECOVER, None, _S.FLYING),
    Transition(_S.ON_GROUND, _E.TAKEOFF, None, _S.LIFTING_OFF, _M._begin),
    Transition(_S.LIFTING_OFF, _E.TICK, _M._open_loop_over, _S.CLIMBING, _M._send_hover_point),
    Transition(_S.LIFTING_OFF, _E.TICK, _M._lifted_off, _S.LIFTED),
    Transition(
        _S.LIFTED, _E.TICK, _M._open_loop_over, _S.CLIMBING, _M._send_hover_point_and_thrust
    ),
    Transition(_S.CLIMBING, _E.TICK, _M._takeoff_over_but_still_down, _S.RAMPING_DOWN, _M._begin),
    Transition(_S.CLIMBING, _E.TICK, _M._takeoff_over, _S.FLYING),
    *(
        row
        for state in (*_TAKEOFF, _S.FLYING)
        for row in (
            Transition(state, _E.LAND, _M._landings_have_a_descent, _S.DESCENDING, _M._begin),
            Transition(state, _E.LAND, None, _S.RAMPING_DOWN, _M._begin),
        )
    ),
    Transition(
        _S.DESCENDING, _E.TICK, _M._down_or_descent_over, _S.RAMPING_DOWN, _M._begin_at_once
    ),
    # The ground may be lower than at the takeoff, for example next to a table.
    Transition(_S.RAMPING_DOWN, _E.TICK, _M._still_sinks, _S.DESCENDING, _M._descend_further),
    Transition(_S.RAMPING_DOWN, _E.TICK, _M._ramp_over, _S.TOUCHING_DOWN),
    Transition(
        _S.TOUCHING_DOWN, _E.TICK, _M._down_or_not_seen_or_too_late, _S.ON_GROUND, _M._begin
    ),
    *(
        Transition(state, _E.FILTER_SINKS, None, _S.YIELDED, _M._begin)
        for state in (*_TAKEOFF, *_AIRBORNE_OR_LANDING)
    ),
    Transition(_S.YIELDED, _E.FILTER_SINKS, None, _S.YIELDED),
    Transition(_S.YIELDED, _E.FILTER_PASSES, None, _S.RAMPING_DOWN, _M._begin),
    Transition(_S.YIELDED, _E.FILTER_HOLDS, None, _S.RAMPING_DOWN, _M._begin),
    Transition(_S.YIELDED, _E.TICK, _M._filter_too_late, _S.ON_GROUND, _M._begin),
    # At the beginning of a takeoff the filter may still be down from the last flight.
    *(
        Transition(state, _E.FILTER_DOWN, None, _S.ON_GROUND, _M._begin)
        for state in (*_AIRBORNE_OR_LANDING, _S.YIELDED)
    ),
    *(
        Transition(state, event, None, _S.ON_GROUND, _M._begin)
        for state in (*_TAKEOFF, *_AIRBORNE_OR_LANDING, _S.YIELDED)
        for event in (*STOPS, _E.VEHICLE_LOST)
    ),
)
