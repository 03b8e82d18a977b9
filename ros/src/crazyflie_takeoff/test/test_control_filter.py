"""Which control is passed on, with a clock moved by hand."""

import pytest
from filter_flight import (
    DESCENDING,
    FLYING,
    LANDING,
    LIMITS,
    ON_GROUND,
    TAKING_OFF,
    G,
    level,
)

from crazyflie_takeoff.filter_machine import FilterMachine, LossTimeouts
from crazyflie_takeoff.transition_table import FlightState


class ControlFilter(FilterMachine):
    """A machine whose commanded controls are level hover, and which is given thrusts only."""

    def __init__(self):
        super().__init__(LossTimeouts(0.25, 0.5, 5.0, 3.0), LIMITS)

    def takeoff(self, time, control, thrust):
        return super().takeoff(time, control, level(thrust))

    def commanded(self, time, control):
        return super().commanded(time, control, level(G))


@pytest.fixture
def control_filter():
    """Return a filter that has listened."""
    control_filter = ControlFilter()
    assert control_filter.stop_listening(0.0) is None
    return control_filter


def test_takeoff_control_is_always_passed_on(control_filter):
    assert control_filter.takeoff(0.0, "t1", 9.0) == "t1"
    control_filter.toggle()
    assert control_filter.takeoff(0.1, "t2", 9.0) == "t2"
    control_filter.flight_state = FLYING
    assert control_filter.takeoff(0.2, "t3", 9.0) == "t3"


def test_commanded_control_is_passed_on_in_flight(control_filter):
    control_filter.takeoff(0.0, "t", 9.0)
    control_filter.toggle()
    assert control_filter.commanded(0.01, "c") == "c"
    control_filter.toggle()
    assert control_filter.commanded(0.02, "c") == "t"


def test_commanded_control_is_passed_on_when_takeoff_control_is_old(control_filter):
    control_filter.takeoff(1.0, "t", 9.0)
    assert control_filter.commanded(1.01, "c") == "t"
    assert control_filter.commanded(1.5, "c") == "t"
    assert control_filter.commanded(1.5001, "c") == "c"
    control_filter.takeoff(2.0, "t2", 0.0)
    assert control_filter.commanded(2.01, "c") == "t2"
    assert control_filter.commanded(2.6, "c") == "c"


def test_commanded_control_is_passed_on_without_any_takeoff_control(control_filter):
    assert control_filter.commanded(0.0, "c") == "c"


def test_a_clock_that_is_reset_does_not_keep_the_controller_out(control_filter):
    control_filter.takeoff(5000.0, "t", 9.0)
    assert control_filter.commanded(0.0, "c") == "t"
    assert control_filter.commanded(0.6, "c") == "c"


def test_listens_before_it_passes_a_controller():
    control_filter = ControlFilter()
    assert control_filter.commanded(0.0, "c1") is None
    assert control_filter.commanded(0.1, "c2") is None
    assert control_filter.stop_listening(0.2) == "c2"
    assert control_filter.commanded(0.21, "c3") == "c3"


def test_a_takeoff_control_ends_the_listening():
    control_filter = ControlFilter()
    assert control_filter.commanded(0.0, "c") is None
    assert control_filter.takeoff(0.1, "t", 9.0) == "t"
    assert control_filter.commanded(0.11, "c") == "t"
    assert control_filter.stop_listening(0.2) is None


def test_the_flight_state_tells_a_listening_filter_to_pass_the_controller():
    control_filter = ControlFilter()
    assert control_filter.commanded(0.0, "c1") is None
    control_filter.flight_state = FLYING
    assert control_filter.commanded(0.01, "c2") == "c2"
    # The waiting control is older by now than the one that was passed on.
    assert control_filter.stop_listening(0.2) is None


@pytest.mark.parametrize("state", FlightState)
def test_the_flight_state_decides(control_filter, state):
    control_filter.takeoff(0.0, "t", 9.0)
    control_filter.flight_state = state
    assert control_filter.commanded(0.1, "c") == ("c" if state in (FLYING, DESCENDING) else "t")
    assert control_filter.in_flight == state.in_flight


@pytest.mark.parametrize("toggle_first", [True, False])
def test_state_and_toggle_of_one_event_do_not_cancel_each_other(control_filter, toggle_first):
    def happen(state):
        if toggle_first:
            control_filter.toggle()
        control_filter.flight_state = state
        if not toggle_first:
            control_filter.toggle()

    for state in (FLYING, LANDING, ON_GROUND, TAKING_OFF, FLYING):
        happen(state)
        assert control_filter.in_flight == state.in_flight


def test_on_the_ground_the_controller_stays_out_when_the_server_dies(control_filter):
    control_filter.flight_state = ON_GROUND
    assert control_filter.commanded(0.0, "c") is None
    control_filter.takeoff(1.0, "zero", 0.0)
    assert control_filter.commanded(60.0, "c") == "zero"


def test_a_server_without_flight_state_may_take_over(control_filter):
    control_filter.flight_state = ON_GROUND
    control_filter.takeoff(0.0, "zero", 0.0)
    control_filter.takeoff(60.0, "lift", 0.5)
    assert control_filter.commanded(60.4, "c") == "lift"
    assert control_filter.commanded(60.6, "c") == "c"


def test_remembers_what_it_has_been_told(control_filter):
    assert control_filter.remembered is None
    control_filter.toggle()
    assert control_filter.remembered is FLYING
    control_filter.toggle()
    assert control_filter.remembered is None
    for state in FlightState:
        control_filter.flight_state = state
        control_filter.toggle()
        assert control_filter.remembered is state


@pytest.mark.parametrize(
    ("thrust", "state", "in_flight", "reports_ground"),
    [
        (0.0, None, False, True),
        (0.0, ON_GROUND, False, True),
        (-0.5, ON_GROUND, False, True),
        (0.5, ON_GROUND, False, False),
        (0.0, TAKING_OFF, False, False),
        (0.0, FLYING, False, False),
        (0.0, None, True, False),
        (None, None, False, False),
        (None, ON_GROUND, False, False),
    ],
)
def test_the_server_reports_the_ground_by_zero_thrust(
    control_filter, thrust, state, in_flight, reports_ground
):
    if thrust is not None:
        control_filter.takeoff(0.0, "t", thrust)
    if in_flight:
        control_filter.toggle()
    control_filter.flight_state = state
    assert control_filter.server_reports_ground == reports_ground


@pytest.mark.parametrize(
    ("thrust", "state", "on_ground"),
    [
        (0.0, None, True),
        (0.5, None, False),
        (0.0, TAKING_OFF, False),
        (0.0, LANDING, True),
        (0.0, FLYING, False),
        (0.0, DESCENDING, False),
    ],
)
def test_a_vehicle_is_on_the_ground_as_far_as_is_known(control_filter, thrust, state, on_ground):
    control_filter.takeoff(0.0, "t", thrust)
    control_filter.flight_state = state
    assert control_filter.is_on_ground == on_ground
    control_filter.stop("it was called")
    control_filter.tick(3.0)
    control_filter.tick(9.0)
    assert control_filter.is_on_ground


def test_the_controller_is_needed_between_takeoff_and_flight_after_half_a_second(control_filter):
    assert not control_filter.selects_controller(9.0)
    control_filter.takeoff(1.0, "t", 0.5)
    assert control_filter.takeoff_age(1.25) == 0.25
    assert [control_filter.selects_controller(time) for time in (1.5, 1.51)] == [False, True]
    control_filter.toggle()
    assert [control_filter.selects_controller(time) for time in (1.25, 1.26)] == [False, True]
    assert control_filter.remembered is FLYING
    control_filter.flight_state = ON_GROUND
    assert control_filter.remembered is ON_GROUND
