"""Which setpoints are passed on."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_driver.setpoint_gate import (
    OVERLAP,
    REASONS,
    STREAM_PAUSE,
    TRANSITIONS,
    Block,
    GateEvent,
    SetpointGate,
    SetpointKind,
)

ZERO, THRUST, REFERENCE = SetpointKind.ZERO_THRUST, SetpointKind.THRUST, SetpointKind.REFERENCE


def opened():
    """Return the gate of a vehicle that is there for long, and was sent zero thrust."""
    gate = SetpointGate()
    gate.listen(-100.0)
    assert gate.refusal(-50.0, ZERO) == ""
    return gate


def stream(gate, begin, end, period=0.02, control=THRUST):
    """Stream setpoints; return how many were refused, and why the last one was."""
    times = [begin + k * period for k in range(round((end - begin) / period))]
    refusals = [gate.refusal(time, control) for time in times]
    return sum(map(bool, refusals)), refusals[-1]


@pytest.fixture
def lost():
    """Return a gate whose link was lost and is back at 2 s, while a node streams."""
    gate = opened()
    assert stream(gate, 0.0, 1.0) == (0, "")
    gate.handle(GateEvent.LINK_LOST)
    assert stream(gate, 1.0, 2.0) == (50, "the link is lost")
    gate.handle(GateEvent.LINK_BACK)
    return gate


def test_what_was_streamed_before_a_loss_stays_blocked(lost):
    count, why = stream(lost, 2.0, 60.0)
    assert count == 2900
    assert why.startswith(
        "the link was lost, or the vehicle called to fly, and it has not reported"
    )
    assert lost.is_blocking(60.0)
    assert not lost.is_blocking(62.0)


def test_a_flight_that_goes_on_opens_it(lost):
    lost.handle(GateEvent.FLIGHT_REPORTED)
    assert stream(lost, 2.0, 3.0) == (0, "")


def test_a_call_for_a_flight_opens_it_for_another_stream_only(lost):
    lost.handle(GateEvent.FLIGHT_CALLED)
    lost.handle(GateEvent.FLIGHT_REPORTED)
    count, why = stream(lost, 2.0, 60.0)
    assert count == 2900
    assert why.startswith("it comes since before the vehicle was added, disarmed or called to fly")
    assert stream(lost, 60.0 + STREAM_PAUSE + 0.1, 62.0) == (0, "")


@pytest.fixture
def standing():
    """Return a gate whose vehicle has not lifted off at 2 s, while a node streams."""
    gate = opened()
    assert stream(gate, 0.0, 2.0) == (0, "")
    gate.handle(GateEvent.NOT_LIFTED)
    return gate


def test_what_was_streamed_while_a_vehicle_did_not_lift_off_stays_blocked(standing):
    # Its motors have run: for 2 s more it says that it flies.
    standing.handle(GateEvent.FLIGHT_REPORTED)
    count, why = stream(standing, 2.0, 60.0)
    assert count == 2900
    assert why.startswith("the vehicle was commanded to fly and did not lift off")


def test_a_new_stream_and_zero_thrust_are_new_attempts_and_a_call_is_none(standing):
    assert stream(standing, 2.0 + STREAM_PAUSE + 0.1, 4.0) == (0, "")
    standing.handle(GateEvent.NOT_LIFTED)
    assert standing.refusal(4.0, ZERO) == ""
    assert stream(standing, 4.02, 5.0) == (0, "")
    standing.handle(GateEvent.NOT_LIFTED)
    standing.handle(GateEvent.FLIGHT_CALLED)
    assert stream(standing, 5.0, 6.0)[0] == 50


@pytest.mark.parametrize(("control", "refused"), [(REFERENCE, 0), (THRUST, 40)])
def test_after_a_pause_references_open_it_and_thrust_begins_at_zero(lost, control, refused):
    """A node that is started again pauses, too, and its first thrust is that of a flight."""
    assert stream(lost, 2.0, 2.2)[0] == 10
    assert stream(lost, 2.2 + STREAM_PAUSE, 4.0, control=control)[0] == refused


@pytest.mark.parametrize(("control", "refused"), [(REFERENCE, 0), (THRUST, 50)])
def test_so_it_is_with_a_pause_during_the_loss(control, refused):
    gate = opened()
    stream(gate, 0.0, 1.0)
    gate.handle(GateEvent.LINK_LOST)
    gate.handle(GateEvent.LINK_BACK)
    assert stream(gate, 3.0, 4.0, control=control)[0] == refused


def test_zero_thrust_opens_it(lost):
    assert lost.refusal(2.0, ZERO) == ""
    assert stream(lost, 2.02, 3.0) == (0, "")


def test_nothing_opens_it_without_a_link():
    gate = opened()
    gate.handle(GateEvent.LINK_LOST)
    gate.handle(GateEvent.FLIGHT_CALLED)
    assert gate.refusal(0.0, ZERO) == "the link is lost"
    assert gate.refusal(5.0, THRUST) == "the link is lost"
    gate.handle(GateEvent.LINK_BACK)
    assert gate.refusal(5.1, THRUST)


@pytest.mark.parametrize(
    ("end", "event"),
    [
        (SetpointGate.high_level, "given a high-level command"),
        (SetpointGate.stop, "stopped by cmd_stop"),
    ],
)
def test_a_setpoint_under_way_does_not_follow_the_end_of_a_stream(end, event):
    gate = opened()
    stream(gate, 0.0, 1.0)
    end(gate, 1.0)
    assert gate.refusal(1.0 + 0.5 * OVERLAP, THRUST) == f"the vehicle was just {event}"
    assert gate.refusal(1.0 + 0.5 * OVERLAP, ZERO) == ""
    assert gate.refusal(1.0 + 1.5 * OVERLAP, THRUST) == ""


def test_an_emergency_and_a_removal_are_for_good(lost):
    lost.handle(GateEvent.REMOVAL)
    lost.handle(GateEvent.FLIGHT_CALLED)
    assert lost.refusal(9.0, ZERO) == "the vehicle is being removed"
    lost.handle(GateEvent.EMERGENCY_STOP)
    assert lost.refusal(19.0, ZERO) == "emergency stop"


def test_a_command_that_fails_lets_setpoints_pass_but_not_after_another_one():
    gate = opened()
    stream(gate, 0.0, 1.0)
    gate.resume(gate.high_level(1.0))
    assert gate.refusal(1.0, THRUST) == ""
    first = gate.high_level(1.0)
    gate.high_level(1.0)
    gate.resume(first)
    assert gate.refusal(1.0, THRUST) == "the vehicle was just given a high-level command"


def test_every_event_has_a_transition_and_every_block_a_reason():
    assert {event for event, *_ in TRANSITIONS} == set(GateEvent)
    assert list(REASONS) == list(Block)


@given(st.lists(st.sampled_from(GateEvent), max_size=30))
def test_after_an_emergency_or_a_removal_nothing_passes(events):
    """And without a link; whatever comes in whatever order."""
    gate = opened()
    for event in events:
        gate.handle(event)
    latched = {GateEvent.EMERGENCY_STOP, GateEvent.REMOVAL} & set(events)
    link = [event for event in events if event in (GateEvent.LINK_LOST, GateEvent.LINK_BACK)]
    is_down = bool(link) and link[-1] is GateEvent.LINK_LOST
    battery = [e for e in events if e in (GateEvent.BATTERY_CRITICAL, GateEvent.BATTERY_RECOVERED)]
    is_empty = bool(battery) and battery[-1] is GateEvent.BATTERY_CRITICAL
    is_closed = bool(latched or is_down or is_empty)
    # Of an open gate, thrust may have to begin at zero.
    assert gate.refusal(0.0, THRUST) or not is_closed
    for time, control in ((0.1, ZERO), (5.0, THRUST)):
        assert bool(gate.refusal(time, control)) is is_closed


def test_a_stream_that_was_landed_for_its_battery_must_pause():
    """The voltage comes back by itself as soon as the motors rest."""
    gate = opened()
    assert stream(gate, 0.0, 1.0) == (0, "")
    gate.handle(GateEvent.BATTERY_CRITICAL)
    assert stream(gate, 1.0, 2.0) == (50, "the battery is critical")
    # A pause alone does not do.
    assert stream(gate, 4.0, 5.0) == (50, "the battery is critical")
    gate.handle(GateEvent.BATTERY_RECOVERED)
    count, why = stream(gate, 5.0, 10.0)
    assert count == 250
    assert why.startswith("the vehicle was landed for its battery: pause the stream")
    assert stream(gate, 12.0, 13.0) == (0, "")


def test_a_battery_that_was_never_critical_blocks_nothing():
    gate = opened()
    gate.handle(GateEvent.BATTERY_RECOVERED)
    assert stream(gate, 0.0, 1.0) == (0, "")


@pytest.fixture
def new():
    """Return the gate of a vehicle to which a node has streamed since before it was added."""
    gate = SetpointGate()
    gate.listen(0.0)
    return gate


@pytest.mark.parametrize("control", [THRUST, REFERENCE])
def test_what_was_streamed_before_a_vehicle_was_added_stays_blocked(new, control):
    count, why = stream(new, 0.01, 60.0, control=control)
    assert count == 3000
    assert why.startswith("it comes since before the vehicle was added")
    assert new.is_blocking(60.0)
    assert not new.is_blocking(62.0)


# The others are those of the stream itself.
OPENING = (GateEvent.STREAM_BEGUN, GateEvent.FLIGHT_CALLED, GateEvent.GROUND_COMMANDED)


@pytest.mark.parametrize("event", [e for e in GateEvent if e not in OPENING])
def test_nothing_that_happens_meanwhile_opens_the_gate_of_a_new_vehicle(new, event):
    for begin in (0.01, 2.0):
        assert stream(new, begin, begin + 0.5)[0] == 25
        new.handle(event)
        assert stream(new, begin + 0.5, begin + 1.0)[0] == 25


def test_a_stream_of_references_that_begins_later_is_a_new_one_but_thrust_begins_at_zero(new):
    count, why = stream(new, 2.0, 3.0, control=THRUST)
    assert count == 50
    assert why == "the vehicle has just been added, or disarmed: begin with zero thrust"
    assert stream(new, 4.5, 5.5, control=REFERENCE) == (0, "")


def test_thrust_that_begins_after_a_call_takes_over_a_vehicle_that_flies_and_no_other(new):
    """The call may have armed it only, or it does not lift off."""
    new.handle(GateEvent.FLIGHT_CALLED)
    count, why = stream(new, 2.0, 3.0, control=THRUST)
    assert count == 50
    assert "has not reported a flight since: begin with zero thrust" in why
    new.handle(GateEvent.FLIGHT_REPORTED)
    assert stream(new, 3.0, 4.0, control=THRUST) == (0, "")


def test_references_that_a_gate_never_listened_for_begin_no_stream():
    assert stream(SetpointGate(), 2.0, 3.0, control=REFERENCE)[0] == 50


def test_zero_thrust_opens_the_gate_of_a_new_vehicle(new):
    assert new.refusal(0.01, ZERO) == ""
    assert stream(new, 0.02, 1.0) == (0, "")


@pytest.mark.parametrize("control", [THRUST, REFERENCE])
def test_nothing_is_armed_while_it_would_start_the_motors(new, control):
    """Also where the setpoints are blocked: arming is the call of somebody who wants to fly."""
    assert new.arming_refusal(0.0) == ""
    stream(new, 0.0, 1.0, control=control)
    # The firmware obeys the last one for 2 s.
    assert new.arming_refusal(2.9).startswith("setpoints come that would start its motors at once")
    assert new.arming_refusal(3.1) == ""
    stream(new, 4.0, 5.0, control=control)
    new.refusal(5.0, ZERO)
    assert new.arming_refusal(5.0) == ""
