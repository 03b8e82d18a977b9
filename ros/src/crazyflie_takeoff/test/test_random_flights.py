"""The server's state machine under random events at random times."""

from flight_clock import BARE, PLAN, G
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_takeoff.phases import FilterState, FlightState
from crazyflie_takeoff.server_table import (
    TABLE,
    FilterReport,
    FlightStateMachine,
    Request,
    ServerState,
)

POSITIONS = st.none() | st.tuples(st.just(0.0), st.just(0.0), st.floats(-0.1, 2.0))
CALLS = st.sampled_from([Request.TAKEOFF, Request.LAND])
TICKS = st.tuples(st.floats(0.0, 2.5), POSITIONS)
REFUSES = FilterReport(refusal="two nodes publish")
FILTER = st.sampled_from([*map(FilterReport, FilterState), REFUSES])


def ask(flight, request):
    """Make a request, unless it is refused."""
    if flight.accepts(request):
        flight.request(request)


@given(st.lists(CALLS | TICKS, max_size=40), st.sampled_from([PLAN, BARE]))
def test_flights_that_the_filter_does_not_end(steps, plan):
    """Holds at every tick of every flight."""
    flight = FlightStateMachine(plan, ServerState.ON_GROUND)
    time, in_flight, ramp, last = 0.0, False, None, FlightState.ON_GROUND
    for step in steps:
        if isinstance(step, Request):
            accepted = flight.accepts(step)
            starts = (ServerState.ON_GROUND,)
            if step is Request.LAND:
                starts = (ServerState.LIFTING_OFF, ServerState.CLIMBING, ServerState.FLYING)
            assert accepted == (flight.state in starts)
            ask(flight, step)
            continue
        time += step[0]
        output, state = flight.tick(time, step[1]), flight.flight_state
        in_flight ^= output.toggle
        assert in_flight == state.in_flight
        # The controller has the vehicle; only it follows references.
        assert not (in_flight and output.thrust is not None)
        assert output.reference is None or state.in_flight or state is FlightState.TAKING_OFF
        if state is FlightState.LANDING and last is not FlightState.LANDING:
            ramp = time
        # Zero thrust comes on the ground, or when a whole ramp has gone by.
        if output.thrust == 0.0 and last is not FlightState.ON_GROUND:
            assert last is FlightState.LANDING
            assert time - ramp >= 1.0 - 1e-5
        last = state
        if output.thrust is not None:
            assert 0.0 <= output.thrust <= G + 0.2
    for _ in range(20):
        time += 1.0
        flight.tick(time)
    assert flight.state in (ServerState.ON_GROUND, ServerState.FLYING)


@given(
    st.sampled_from([None, *FlightState]),
    POSITIONS,
    st.lists(CALLS | TICKS | FILTER, max_size=40),
    st.sampled_from([PLAN, BARE]),
)
def test_walks_through_the_table(remembered, position, steps, plan):
    """Every change is a row; a vehicle that the filter has is left to it; walks end at rest."""
    rows = {(state, row.next) for row in TABLE for state in row.phases}
    flight = FlightStateMachine(plan)
    flight.set_filter(FilterReport(remembered=remembered))
    flight.recover(position, 0.0)
    assert (ServerState.RECOVERING, flight.state) in rows
    time = 0.0
    for step in steps:
        before = flight.state
        if isinstance(step, tuple) and not isinstance(step, FilterReport):
            time += step[0]
            output = flight.tick(time, step[1])
            if flight.state is ServerState.YIELDED:
                assert output.thrust is output.reference is None
            continue
        if step in (Request.TAKEOFF, Request.LAND):
            ask(flight, step)
        else:
            flight.set_filter(step)
        assert before is flight.state or (before, flight.state) in rows
        takes_off = before in (ServerState.LIFTING_OFF, ServerState.LIFTED, ServerState.CLIMBING)
        is_report = isinstance(step, FilterReport)
        if is_report and step.takes_over and not (takes_off and step.state is FilterState.DOWN):
            assert flight.state in (ServerState.ON_GROUND, ServerState.YIELDED)
    for _ in range(80):
        time += 1.0
        flight.tick(time)
    assert flight.state in (ServerState.ON_GROUND, ServerState.FLYING)


def test_every_state_is_reached_and_left():
    assert {row.next for row in TABLE} == set(ServerState) - {ServerState.RECOVERING}
    assert {state for row in TABLE for state in row.phases} == set(ServerState)
