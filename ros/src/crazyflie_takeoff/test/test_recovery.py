"""Conclusions of a restarted server from the filter's report and the position."""

import pytest

from crazyflie_takeoff.phases import FilterState, FlightState
from crazyflie_takeoff.profiles import TakeoffPlan
from crazyflie_takeoff.server_table import (
    FilterReport,
    FlightStateMachine,
    ServerState,
)

ON_GROUND, TAKING_OFF, FLYING, DESCENDING, LANDING = FlightState


def recovered(remembered, height, descent_speed=0.3, ground=0.0, **report):
    flight = FlightStateMachine(TakeoffPlan((0.0, 0.0, 1.0), 1.0, 5.0, descent_speed))
    flight.set_filter(FilterReport(remembered=remembered, **report))
    assert flight.state is ServerState.RECOVERING
    flight.recover(None if height is None else (0.0, 0.0, height), ground)
    return flight


@pytest.mark.parametrize(
    ("remembered", "height", "state"),
    [
        (None, None, ON_GROUND),
        (None, 0.0, ON_GROUND),
        (None, 0.14, ON_GROUND),
        (None, 0.16, FLYING),
        (ON_GROUND, None, ON_GROUND),
        (ON_GROUND, 0.1, ON_GROUND),
        (ON_GROUND, 1.0, ON_GROUND),
        (FLYING, None, FLYING),
        (FLYING, 0.0, FLYING),
        (FLYING, 1.0, FLYING),
        *[(unsettled, None, FLYING) for unsettled in (TAKING_OFF, DESCENDING, LANDING)],
        *[(unsettled, 0.04, LANDING) for unsettled in (TAKING_OFF, DESCENDING, LANDING)],
        *[(unsettled, 0.1, DESCENDING) for unsettled in (TAKING_OFF, DESCENDING, LANDING)],
        *[(unsettled, 1.0, DESCENDING) for unsettled in (TAKING_OFF, DESCENDING, LANDING)],
    ],
)
def test_state_by_memory_and_height(remembered, height, state):
    assert recovered(remembered, height).flight_state is state


@pytest.mark.parametrize("remembered", [TAKING_OFF, DESCENDING, LANDING])
def test_does_not_drop_a_vehicle_that_cannot_descend(remembered):
    assert recovered(remembered, 1.0, descent_speed=0.0).flight_state is FLYING
    assert recovered(remembered, 0.04, descent_speed=0.0).flight_state is LANDING


@pytest.mark.parametrize("remembered", FlightState)
@pytest.mark.parametrize("height", [None, 0.0, 1.0])
def test_toggles_only_what_the_former_server_has_not(remembered, height):
    flight = recovered(remembered, height)
    is_changed = flight.flight_state.in_flight != remembered.in_flight
    position = None if height is None else (0.0, 0.0, height)
    assert flight.tick(0.0, position).toggle == is_changed


@pytest.mark.parametrize(
    "report",
    [{"state": state} for state in FilterState if state >= FilterState.SINKING]
    + [{"refusal": "two"}],
)
@pytest.mark.parametrize("remembered", [None, FLYING, LANDING])
def test_a_filter_that_has_the_vehicle_keeps_it(report, remembered):
    flight = recovered(remembered, 1.0, **report)
    sinks = report.get("state") is FilterState.SINKING
    assert flight.state is (ServerState.YIELDED if sinks else ServerState.ON_GROUND)
    assert flight.tick(0.0).toggle == (remembered is FLYING)


def test_the_ground_of_a_former_server_counts_only_for_its_flight():
    assert recovered(LANDING, 0.72, ground=0.7).flight_state is LANDING
    assert recovered(None, 0.72, ground=0.7).flight_state is FLYING
    assert recovered(None, 0.72, ground=0.7).ground == 0.0


@pytest.mark.parametrize("remembered", [None, TAKING_OFF, FLYING, DESCENDING, LANDING])
def test_never_on_the_ground_when_it_may_be_in_flight(remembered):
    assert recovered(remembered, 0.16).flight_state is not ON_GROUND


def test_is_on_a_table_when_no_controller_sends_commands():
    assert recovered(None, 0.7, is_commanded=False).flight_state is ON_GROUND
    assert recovered(FLYING, 0.7, is_commanded=False).flight_state is FLYING


def test_a_recovered_descent_waits_while_the_filter_holds_the_vehicle():
    flight = recovered(DESCENDING, 1.0, state=FilterState.HOLDING)
    for k in range(100):
        output = flight.tick(k / 100, (0.0, 0.0, 1.0))
    assert output.reference[2] == 1.0
