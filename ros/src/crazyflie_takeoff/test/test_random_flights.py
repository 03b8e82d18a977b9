"""The server's state machine under random events at random times."""

from hypothesis import given
from hypothesis import strategies as st

from crazyflie_takeoff.server_table import (
    TABLE,
    TAKEOVERS,
    FilterReport,
    FlightStateMachine,
    ServerEvent,
    ServerState,
    TakeoffPlan,
)
from crazyflie_takeoff.transition_table import FlightState

G = 9.81
PLAN = TakeoffPlan(hover=(0.1, 0.2, 1.0), open_loop=1.0, settle=5.0, descent_speed=0.3)
BARE = TakeoffPlan(hover=(0.1, 0.2, 1.0), open_loop=1.0, settle=5.0, descent_speed=0.0)

POSITIONS = st.none() | st.tuples(st.just(0.0), st.just(0.0), st.floats(-0.1, 2.0))
CALLS = st.sampled_from([ServerEvent.TAKEOFF, ServerEvent.LAND])
TICKS = st.tuples(st.floats(0.0, 2.5), POSITIONS)
FILTER = st.sampled_from([ServerEvent.FILTER_PASSES, ServerEvent.FILTER_HOLDS, *TAKEOVERS])


@given(st.lists(CALLS | TICKS, max_size=40), st.sampled_from([PLAN, BARE]))
def test_flights_that_the_filter_does_not_end(steps, plan):
    """Holds at every tick of every flight."""
    flight = FlightStateMachine(plan, ServerState.ON_GROUND)
    time, in_flight, ramp, last = 0.0, False, None, FlightState.ON_GROUND
    for step in steps:
        if isinstance(step, ServerEvent):
            accepted = flight.accepts(step)
            starts = (ServerState.ON_GROUND,)
            if step is ServerEvent.LAND:
                starts = (ServerState.LIFTING_OFF, ServerState.CLIMBING, ServerState.FLYING)
            assert accepted == (flight.state in starts)
            flight.handle(step)
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
    rows = {(row.state, row.next) for row in TABLE}
    flight = FlightStateMachine(plan)
    flight.set_filter(FilterReport(remembered=remembered))
    flight.recover(position, 0.0)
    assert (ServerState.RECOVERING, flight.state) in rows
    time = 0.0
    for step in steps:
        before = flight.state
        if isinstance(step, tuple):
            time += step[0]
            output = flight.tick(time, step[1])
            if flight.state is ServerState.YIELDED:
                assert output.thrust is output.reference is None
            continue
        if step in (ServerEvent.TAKEOFF, ServerEvent.LAND):
            flight.handle(step)
        else:
            flight.set_filter(FilterReport(step))
        assert before is flight.state or (before, flight.state) in rows
        takes_off = before in (ServerState.LIFTING_OFF, ServerState.CLIMBING)
        if step in TAKEOVERS and not (takes_off and step is ServerEvent.FILTER_DOWN):
            assert flight.state in (ServerState.ON_GROUND, ServerState.YIELDED)
    for _ in range(80):
        time += 1.0
        flight.tick(time)
    assert flight.state in (ServerState.ON_GROUND, ServerState.FLYING)


def test_every_state_is_reached_and_left():
    assert {row.next for row in TABLE} == set(ServerState) - {ServerState.RECOVERING}
    assert {row.state for row in TABLE} == set(ServerState)
