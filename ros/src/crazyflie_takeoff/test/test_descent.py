"""The descent of a landing, with a clock moved by hand."""

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

from crazyflie_takeoff.phases import FilterState
from crazyflie_takeoff.server_table import FilterReport, FlightStateMachine, Request


def landing(position, seconds, plan=PLAN):
    """Return a flight whose landing has lasted for a while, and its clock."""
    flight = flying(plan)
    flight.request(Request.LAND)
    return flight, Clock(flight, position=position).run(seconds)


def test_landing_descends_first():
    flight, clock = landing((0.5, -0.5, 1.0), 0.0)
    clock.run(1.0)
    assert clock.thrusts() == []
    assert clock.toggles() == []
    assert flight.flight_state is DESCENDING
    expected = [
        (pytest.approx(k / 100), pytest.approx((0.5, -0.5, 1.0 - 0.003 * k, 0.0, 0.0, -0.3)))
        for k in range(100)
    ]
    assert clock.references() == expected
    clock.position = (0.5, -0.5, 0.051)
    clock.run(0.5)
    assert clock.thrusts() == []
    clock.position = (0.5, -0.5, 0.049)
    clock.run(2.0)
    assert clock.thrusts()[0] == (1.5, G)
    assert clock.toggles() == [1.5]
    assert flight.flight_state is ON_GROUND
    assert clock.thrusts()[100] == (2.5, 0.0)


def test_the_ground_is_where_the_vehicle_took_off():
    flight = grounded()
    Clock(flight, position=(0.0, 0.0, 0.7), start=0.0).run(0.1)
    flight.request(Request.TAKEOFF)
    Clock(flight, position=(0.0, 0.0, 1.5), start=1.0).run(6.01)
    flight.request(Request.LAND)
    clock = Clock(flight, position=(0.0, 0.0, 0.76)).run(0.1)
    assert flight.flight_state is DESCENDING
    clock.position = (0.0, 0.0, 0.74)
    clock.run(0.01)
    assert flight.flight_state is LANDING


def test_the_reference_presses_only_a_little_below_the_ground():
    flight, clock = landing((0.0, 0.0, 0.5), 4.5)
    heights = [reference[2] for _, reference in clock.references()]
    assert min(heights) == pytest.approx(-0.3)
    assert clock.references()[-1][1] == pytest.approx((0.0, 0.0, -0.3, 0.0, 0.0, 0.0))


def test_a_vehicle_that_does_not_descend_is_landed_all_the_same():
    flight, clock = landing((0.0, 0.0, 1.0), 0.0)
    assert clock.run_until(LANDING) == pytest.approx(1.0 / 0.3 + 3.0, abs=0.011)
    # Zero thrust for at most two seconds until the vehicle is down.
    assert clock.run_until(ON_GROUND) == pytest.approx(1.0 / 0.3 + 6.0, abs=0.03)
    assert clock.thrusts()[-1][1] == 0.0


def test_waits_for_the_touchdown_when_the_height_is_known():
    flight, clock = landing((0.0, 0.0, 0.2), 1.5, BARE)
    assert flight.flight_state is LANDING
    assert [thrust for _, thrust in clock.thrusts()[100:]] == [0.0] * 5
    clock.position = (0.0, 0.0, 0.01)
    assert clock.run_until(ON_GROUND) == pytest.approx(1.5)
    assert clock.said[-1][1].thrust == 0.0


def test_a_vehicle_that_sinks_in_the_ramp_was_not_on_the_ground():
    flight, clock = landing((0.0, 0.0, 0.04), 0.3)
    assert flight.flight_state is LANDING
    clock.position = (0.0, 0.0, -0.05)
    clock.run(0.1)
    assert flight.flight_state is LANDING
    clock.said.clear()
    clock.position = (0.1, 0.0, -0.07)
    begin = clock.ticks
    clock.run(1.0)
    # The controller has it again, on a way down without an end.
    assert flight.flight_state is DESCENDING
    assert [time for time, output in clock.said if output.toggle] == [begin / 100]
    expected = [pytest.approx((0.1, 0.0, -0.07 - 0.003 * k, 0.0, 0.0, -0.3)) for k in range(100)]
    assert [reference for _, reference in clock.references()] == expected
    # As long as it sinks by 2 cm in 2 s, it is in the air.
    for k in range(10):
        clock.position = (0.1, 0.0, -0.091 - 0.021 * k)
        clock.run(1.89)
        assert flight.flight_state is DESCENDING
    # 20 s are enough.
    clock.position = (0.1, 0.0, -0.5)
    clock.run(0.2)
    assert flight.flight_state is LANDING
    clock.run(3.0)
    assert flight.flight_state is ON_GROUND


def test_a_vehicle_that_has_stopped_sinking_is_down():
    flight, clock = landing((0.0, 0.0, 0.04), 0.1)
    clock.position = (0.0, 0.0, -0.5)
    clock.run(0.1)
    assert flight.flight_state is DESCENDING
    begin = clock.ticks
    assert clock.run_until(LANDING) == pytest.approx((begin + 190) / 100, abs=0.03)
    clock.run(3.0)
    assert flight.flight_state is ON_GROUND
    # The next landing is to where the vehicle took off, again.
    flight.request(Request.TAKEOFF)
    clock.position = (0.0, 0.0, 0.5)
    clock.run(6.1)
    flight.request(Request.LAND)
    clock.position = (0.0, 0.0, -0.44)
    clock.run(0.5)
    assert flight.flight_state is DESCENDING
    clock.position = (0.0, 0.0, -0.46)
    clock.run(0.01)
    assert flight.flight_state is LANDING


def test_the_bare_ramp_is_not_taken_back():
    flight, clock = landing((0.0, 0.0, 1.0), 0.5, BARE)
    clock.position = (0.0, 0.0, 0.5)
    clock.run(0.4)
    assert flight.flight_state is LANDING


def test_a_descent_without_a_state_goes_on_by_dead_reckoning():
    flight, clock = landing((0.0, 0.0, 1.0), 1.0)
    clock.position = None
    clock.run(1.0)
    expected = [
        (pytest.approx(k / 100), pytest.approx((0.0, 0.0, 1.0 - 0.003 * k, 0.0, 0.0, -0.3)))
        for k in range(200)
    ]
    assert clock.references() == expected
    # The motors are stopped when there has been time enough to sink.
    assert clock.run_until(LANDING) == pytest.approx(1.0 / 0.3 + 3.0, abs=0.011)
    assert clock.thrusts() == [(pytest.approx(1.0 / 0.3 + 3.0, abs=0.011), G)]
    assert clock.run_until(ON_GROUND) == pytest.approx(1.0 / 0.3 + 4.0, abs=0.03)


def test_a_descent_goes_on_from_where_the_vehicle_is_seen_again():
    flight, clock = landing((0.0, 0.0, 2.0), 1.0)
    clock.position = None
    clock.run(2.0)
    clock.position = (0.1, -0.1, 1.9)
    clock.said.clear()
    clock.run(1.0)
    expected = [pytest.approx((0.1, -0.1, 1.9 - 0.003 * k, 0.0, 0.0, -0.3)) for k in range(100)]
    assert [reference for _, reference in clock.references()] == expected
    # It has as long as if it had begun there.
    assert clock.run_until(LANDING) == pytest.approx(3.0 + 1.9 / 0.3 + 3.0, abs=0.011)


def test_a_descent_that_begins_without_a_state_begins_where_the_vehicle_was_seen_last():
    flight = flying()
    Clock(flight, position=(0.5, -0.5, 0.8), start=6.01).run(0.1)
    clock = Clock(flight, start=6.11).run(1.0)
    flight.request(Request.LAND)
    clock.said.clear()
    clock.run(0.5)
    assert flight.flight_state is DESCENDING
    expected = [pytest.approx((0.5, -0.5, 0.8 - 0.003 * k, 0.0, 0.0, -0.3)) for k in range(50)]
    assert [reference for _, reference in clock.references()] == expected


@pytest.mark.parametrize("seen", [0.7, None])
def test_a_descent_waits_while_the_filter_holds_the_vehicle(seen):
    flight, clock = landing((0.0, 0.0, 1.0), 1.0)
    clock.position = None if seen is None else (0.0, 0.0, seen)
    height = seen or 1.0
    flight.set_filter(FilterReport(FilterState.HOLDING))
    clock.run(2.0)
    assert clock.references()[-1][1] == pytest.approx((0, 0, height, 0, 0, -0.3), abs=0.005)
    flight.set_filter(FilterReport())
    clock.run(1.0)
    assert clock.references()[-1][1] == pytest.approx((0, 0, height - 0.3, 0, 0, -0.3), abs=0.01)
    assert clock.run_until(LANDING) == pytest.approx(3.0 + height / 0.3 + 3.0, abs=0.05)


def test_the_descent_of_a_restarted_server_waits_while_the_filter_holds_the_vehicle():
    flight = FlightStateMachine(PLAN)
    flight.set_filter(FilterReport(FilterState.HOLDING, DESCENDING))
    flight.recover((0.0, 0.0, 1.0), ground=0.0)
    clock = Clock(flight, position=(0.0, 0.0, 1.0)).run(2.0)
    assert flight.flight_state is DESCENDING
    assert {reference[2] for _, reference in clock.references()} == {1.0}
    flight.set_filter(FilterReport(FilterState.PASSING, DESCENDING))
    clock.run(1.0)
    assert clock.references()[-1][1] == pytest.approx((0, 0, 0.7, 0, 0, -0.3), abs=0.01)


def test_a_descent_that_is_held_for_ever_ends():
    flight = flying()
    flight.request(Request.LAND)
    flight.set_filter(FilterReport(FilterState.HOLDING))
    clock = Clock(flight, position=(0.0, 0.0, 1.0))
    assert clock.run_until(LANDING, 100.0) == pytest.approx(60.0 + 1.0 / 0.3 + 3.0, abs=0.05)


def test_a_descent_keeps_its_speed_when_the_plan_changes():
    flight = flying()
    flight.request(Request.LAND)
    flight.plan = BARE
    clock = Clock(flight, position=(0.0, 0.0, 1.0)).run(1.0)
    assert clock.references()[-1][1] == pytest.approx((0.0, 0.0, 0.703, 0.0, 0.0, -0.3))


@pytest.mark.parametrize("sees", [True, False])
def test_a_descent_under_way_is_made_faster(sees):
    flight, clock = landing((0.0, 0.0, 4.0), 1.0)
    clock.position = (0.0, 0.0, 3.7) if sees else None
    clock.run(0.01)
    clock.said.clear()
    flight.limit_descent(7.0)
    clock.run(1.0)
    (_, first), (_, last) = clock.references()[0], clock.references()[-1]
    assert first == pytest.approx((0.0, 0.0, 3.7, 0.0, 0.0, -3.7 / 7.0), abs=0.01)
    assert last[2] == pytest.approx(3.7 - 0.99 * 3.7 / 7.0, abs=0.01)


def test_a_descent_above_a_table_is_made_as_fast_as_it_must_be():
    flight = grounded()
    flight.tick(0.0, (0.0, 0.0, 0.75))
    flight.request(Request.TAKEOFF)
    Clock(flight, position=(0.0, 0.0, 2.75), start=1.0).run(6.01)
    flight.request(Request.LAND)
    flight.limit_descent(2.5)
    assert flight.tick(8.0, (0.0, 0.0, 2.75)).reference[5] == pytest.approx(-2.0 / 2.5)


def test_a_descent_that_is_fast_enough_is_not_made_slower():
    flight, clock = landing((0.0, 0.0, 1.0), 1.0)
    flight.limit_descent(7.0)
    clock.run(0.01)
    assert clock.references()[-1][1][5] == -0.3


@pytest.mark.parametrize("state", [ON_GROUND, TAKING_OFF, FLYING, LANDING])
def test_only_a_descent_is_made_faster(state):
    flight, untouched = in_state(state), in_state(state)
    flight.limit_descent(7.0)
    for k in range(1500):
        moment, position = 6.03 + k / 100, (0.0, 0.0, 1.0)
        assert flight.tick(moment, position) == untouched.tick(moment, position)
