"""The state machine of takeoff and landing, with a clock moved by hand."""

import pytest
from flight_clock import (
    BARE,
    DESCENDING,
    FLYING,
    LANDING,
    ON_GROUND,
    PLAN,
    TAKING_OFF,
    Clock,
    G,
    flying,
    grounded,
    in_state,
)

from crazyflie_takeoff.phases import FlightState
from crazyflie_takeoff.profiles import TakeoffPlan
from crazyflie_takeoff.server_table import Request
from crazyflie_utils.refusal import RefusalError


def test_zero_thrust_is_repeated_at_10_hz_on_the_ground():
    clock = Clock(grounded()).run(1.0)
    assert clock.thrusts() == [(pytest.approx(0.1 * k), 0.0) for k in range(10)]
    assert clock.references() == clock.toggles() == []


def test_takeoff_step_by_step():
    flight = grounded()
    clock = Clock(flight).run(0.37)
    clock.said.clear()
    clock.states.clear()
    flight.request(Request.TAKEOFF)
    clock.run(10.0)
    assert clock.thrusts() == [(pytest.approx(0.37 + k / 100), G + 0.2) for k in range(100)]
    assert clock.references() == [(pytest.approx(1.37), (0.1, 0.2, 1.0, 0.0, 0.0, 0.0))]
    assert clock.toggles() == [pytest.approx(6.37)]
    assert clock.states == [TAKING_OFF] * 600 + [FLYING] * 400


@pytest.mark.parametrize(("open_loop", "settle"), [(0.0, 1.0), (0.5, 0.0), (0.0, 0.0)])
def test_durations_may_be_zero(open_loop, settle):
    flight = grounded(TakeoffPlan((0.0, 0.0, 1.0), open_loop, settle, 0.3))
    flight.request(Request.TAKEOFF)
    clock = Clock(flight).run(3.0)
    assert len(clock.thrusts()) == round(open_loop * 100)
    assert [time for time, _ in clock.references()] == [open_loop]
    assert clock.toggles() == [open_loop + settle]


@pytest.mark.parametrize(("settle", "state"), [(2.9, FLYING), (3.0, LANDING)])
def test_a_vehicle_that_has_not_lifted_off_in_three_seconds_cannot_fly(settle, state):
    flight = grounded(TakeoffPlan((0.0, 0.0, 1.0), 0.5, settle, 0.3))
    flight.request(Request.TAKEOFF)
    Clock(flight, position=(0.0, 0.0, 0.0)).run(0.5 + settle + 0.1)
    assert flight.flight_state is state


def test_a_tick_that_is_very_late_skips_nothing():
    flight = grounded()
    flight.request(Request.TAKEOFF)
    flight.tick(0.0)
    output = flight.tick(100.0)
    assert output.reference == (0.1, 0.2, 1.0, 0.0, 0.0, 0.0)
    assert output.toggle
    assert flight.flight_state is FLYING


def test_bare_landing_step_by_step():
    flight = flying(BARE)
    flight.request(Request.LAND)
    clock = Clock(flight).run(2.0)
    ramp = [(pytest.approx(k / 100), pytest.approx(G - 5.0 * k / 100)) for k in range(100)]
    zeros = [(pytest.approx(1.0 + k / 10), 0.0) for k in range(10)]
    assert clock.thrusts() == ramp + zeros
    assert clock.references() == []
    assert clock.toggles() == [0.0]
    assert clock.states == [LANDING] * 100 + [ON_GROUND] * 100


def test_a_landing_that_does_not_know_the_height_is_bare():
    flight = flying(PLAN)
    flight.request(Request.LAND)
    clock = Clock(flight, position=None).run(1.01)
    assert clock.thrusts()[0] == (0.0, G)
    assert clock.references() == []
    assert flight.flight_state is ON_GROUND


def test_flights_can_be_repeated():
    flight = grounded()
    clock = Clock(flight, position=(0.0, 0.0, 0.0))
    for _ in range(3):
        clock.said.clear()
        flight.request(Request.TAKEOFF)
        clock.position = (0.0, 0.0, 1.0)
        clock.run(6.01)
        assert len(clock.references()) == 1
        assert len(clock.toggles()) == 1
        clock.position = (0.0, 0.0, 0.0)
        flight.request(Request.LAND)
        clock.run(1.01)
        assert len(clock.toggles()) == 2
        assert flight.flight_state is ON_GROUND


@pytest.mark.parametrize("state", FlightState)
@pytest.mark.parametrize("name", ["takeoff", "land"])
def test_refusals_say_why_and_change_nothing(state, name):
    flight, untouched = in_state(state), in_state(state)
    event = Request[name.upper()]
    if (state, name) in [(ON_GROUND, "takeoff"), (FLYING, "land"), (TAKING_OFF, "land")]:
        flight.request(event)
        assert flight.flight_state is not state
        return
    words = {
        ON_GROUND: "on the ground",
        TAKING_OFF: "takeoff is under way",
        FLYING: "in flight",
        DESCENDING: "landing is under way",
        LANDING: "landing is under way",
    }
    with pytest.raises(RefusalError, match=words[state]):
        flight.request(event)
    for k in range(1500):
        moment, position = 6.03 + k / 100, (0.0, 0.0, max(0.0, 1.0 - k * 0.003))
        assert flight.tick(moment, position) == untouched.tick(moment, position)


def test_an_aborted_takeoff_is_a_landing():
    flight = in_state(TAKING_OFF)
    flight.request(Request.LAND)
    clock = Clock(flight, position=(0.0, 0.0, 0.5)).run(1.0)
    # In flight for the descent, and then no more.
    assert clock.toggles() == [0.0]
    clock.position = (0.0, 0.0, 0.0)
    clock.run_until(ON_GROUND)
    assert clock.toggles() == [0.0, 1.0]


def test_a_takeoff_aborted_near_the_ground_was_never_in_flight():
    flight = in_state(TAKING_OFF)
    flight.request(Request.LAND)
    clock = Clock(flight, position=(0.0, 0.0, 0.01)).run(1.01)
    assert flight.flight_state is ON_GROUND
    assert clock.toggles() == []


def test_goes_on_when_the_clock_is_reset():
    flight = grounded()
    flight.request(Request.TAKEOFF)
    Clock(flight, start=5000.0).run(0.5)
    clock = Clock(flight, start=0.0).run(7.0)
    assert len(clock.thrusts()) == pytest.approx(51, abs=1)
    assert clock.toggles() == [pytest.approx(5.51, abs=0.011)]
    waiting = grounded()
    Clock(waiting, start=5000.0).run(0.55)
    assert len(Clock(waiting, start=0.0).run(1.0).thrusts()) == 10
