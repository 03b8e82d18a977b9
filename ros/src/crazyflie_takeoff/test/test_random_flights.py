"""The state machine of takeoff and landing under random calls at random times."""

from hypothesis import given, settings
from hypothesis import strategies as st

from crazyflie_takeoff.flight import FlightStateMachine, Plan
from crazyflie_takeoff.flight_state import FlightState
from crazyflie_utils.refusal import RefusalError

G = 9.81
PLAN = Plan(hover=(0.1, 0.2, 1.0), open_loop=1.0, settle=5.0, descent_speed=0.3)
BARE = Plan(hover=(0.1, 0.2, 1.0), open_loop=1.0, settle=5.0, descent_speed=0.0)

ON_GROUND, TAKING_OFF, FLYING, DESCENDING, LANDING = FlightState

STEPS = st.lists(
    st.one_of(
        st.sampled_from(["takeoff", "land", "abort"]),
        st.tuples(
            st.floats(0.0, 2.5),
            st.one_of(st.none(), st.tuples(st.just(0.0), st.just(0.0), st.floats(-0.1, 2.0))),
        ),
    ),
    max_size=40,
)


@settings(max_examples=200, deadline=None)
@given(STEPS, st.sampled_from([PLAN, BARE]))
def test_whatever_is_called_when(steps, plan):
    """Random calls and times: what must hold at every tick of every flight."""
    flight = FlightStateMachine(plan)
    time, in_flight, ramp, last = 0.0, False, None, ON_GROUND
    for step in steps:
        before = flight.state
        if step == "abort":
            flight.abort()
            assert before is TAKING_OFF or flight.state is before
        elif isinstance(step, str):
            allowed = before in ((ON_GROUND,) if step == "takeoff" else (TAKING_OFF, FLYING))
            try:
                getattr(flight, step)()
                assert allowed
            except RefusalError:
                assert not allowed
                assert flight.state is before
        else:
            time += step[0]
            output = flight.tick(time, step[1])
            in_flight ^= output.toggle
            assert output.state is flight.state
            assert in_flight == flight.state.in_flight
            # The controller's vehicle is left alone; references are its alone.
            assert not (in_flight and output.thrust is not None)
            assert output.reference is None or flight.state in (TAKING_OFF, FLYING, DESCENDING)
            if flight.state is LANDING and last is not LANDING:
                ramp = time
            # Zero thrust comes on the ground, or when a whole ramp has gone by.
            if output.thrust == 0.0 and last is not ON_GROUND:
                assert last is LANDING
                assert time - ramp >= 1.0 - 1e-5
            last = flight.state
            if output.thrust is not None:
                assert 0.0 <= output.thrust <= G + 0.2
    for _ in range(20):
        time += 1.0
        flight.tick(time)
    assert flight.state.is_settled
