"""Which control is passed on, with a clock moved by hand."""

import pytest
from filter_flight import DESCENDING, FLYING, LANDING, ON_GROUND, TAKING_OFF, G, Supervised, level

from crazyflie_takeoff.facts import Timeouts
from crazyflie_takeoff.phases import FlightState


class ControlFilter(Supervised):
    """A supervisor whose commanded controls are level hover, and which is given thrusts only."""

    def __init__(self):
        super().__init__(Timeouts(0.25, 0.5, 5.0, 3.0))

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
    assert control_filter.facts.in_flight == state.in_flight


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
        assert control_filter.facts.in_flight == state.in_flight


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
    assert control_filter.facts.remembered is None
    control_filter.toggle()
    assert control_filter.facts.remembered is FLYING
    control_filter.toggle()
    assert control_filter.facts.remembered is None
    for state in FlightState:
        control_filter.flight_state = state
        control_filter.toggle()
        assert control_filter.facts.remembered is state


@pytest.mark.parametrize(
    ("thrust", "state", "in_flight", "reports_ground", "stands"),
    [
        (0.0, None, False, True, True),
        (0.0, ON_GROUND, False, True, True),
        (-0.5, ON_GROUND, False, True, True),
        (0.5, ON_GROUND, False, False, False),
        (0.5, None, False, False, False),
        (0.0, TAKING_OFF, False, False, False),
        (0.0, LANDING, False, False, True),
        (0.0, FLYING, False, False, False),
        (0.0, DESCENDING, False, False, False),
        (0.0, None, True, False, False),
        (None, None, False, False, True),
        (None, ON_GROUND, False, False, True),
    ],
)
def test_what_shows_that_the_vehicle_is_on_the_ground(
    control_filter, thrust, state, in_flight, reports_ground, stands
):
    if thrust is not None:
        control_filter.takeoff(0.0, "t", thrust)
    if in_flight:
        control_filter.toggle()
    control_filter.flight_state = state
    facts = control_filter.facts
    assert (facts.server_reports_ground, facts.stands) == (reports_ground, stands)


def test_the_controller_is_needed_between_takeoff_and_flight_after_half_a_second(control_filter):
    facts = control_filter.facts

    def needs(time):
        control_filter.tick(time)
        return facts.needs_controller

    assert not needs(0.9)
    control_filter.takeoff(1.0, "t", 0.5)
    assert [needs(time) for time in (1.5, 1.51)] == [False, True]
    assert facts.takeoff_age == pytest.approx(0.51)
    control_filter.toggle()
    control_filter.takeoff(2.0, "t", 0.5)
    assert [needs(time) for time in (2.25, 2.26)] == [False, True]
    assert facts.remembered is FLYING
    control_filter.flight_state = ON_GROUND
    assert facts.remembered is ON_GROUND
