"""The state machine of takeoff and landing as a table: what runs, and what the diagram shows.

Heights and positions are in the fixed frame (z up), m; times are s.
"""

import math
from dataclasses import dataclass

from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.descent import Descent
from crazyflie_takeoff.flight_state import FlightState
from crazyflie_takeoff.ground import TOUCHDOWN_HEIGHT
from crazyflie_takeoff.motion import Position
from crazyflie_takeoff.server_states import NO_FILTER, STOPS, Event, FilterReport, ServerState
from crazyflie_takeoff.transition_table import Table, Transition

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
