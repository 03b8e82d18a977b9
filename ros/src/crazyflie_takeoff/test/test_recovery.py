"""What a server that has just started makes of what it is told."""

import pytest

from crazyflie_takeoff.flight_state import FlightState
from crazyflie_takeoff.recovery import recover_state

ON_GROUND, TAKING_OFF, FLYING, DESCENDING, LANDING = FlightState


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
def test_where_the_flight_stands(remembered, height, state):
    assert recover_state(remembered, height).state is state


@pytest.mark.parametrize("remembered", [TAKING_OFF, DESCENDING, LANDING])
def test_does_not_drop_a_vehicle_that_cannot_descend(remembered):
    assert recover_state(remembered, 1.0, can_descend=False).state is FLYING
    assert recover_state(remembered, 0.04, can_descend=False).state is LANDING


@pytest.mark.parametrize("remembered", FlightState)
@pytest.mark.parametrize("height", [None, 0.0, 1.0])
def test_knows_what_has_been_announced(remembered, height):
    assert recover_state(remembered, height).announced == remembered.in_flight


@pytest.mark.parametrize("remembered", [None, TAKING_OFF, FLYING, DESCENDING, LANDING])
def test_never_on_the_ground_when_it_may_be_in_flight(remembered):
    assert recover_state(remembered, 0.16).state is not ON_GROUND


def test_stands_on_a_table_when_no_controller_speaks():
    assert recover_state(None, 0.7, is_commanded=False).state is ON_GROUND
    assert recover_state(FLYING, 0.7, is_commanded=False).state is FLYING


def test_says_why():
    assert recover_state(None, None).reason == "nothing is remembered, the height is not known"
    assert recover_state(FLYING, 1.0).reason == "flying is remembered, the height is 1.00 m"
