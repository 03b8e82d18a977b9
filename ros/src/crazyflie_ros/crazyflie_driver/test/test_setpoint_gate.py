"""Which setpoints are passed on."""

import threading
from functools import partial

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
)


def stream(gate, begin, end, period=0.02, is_zero=False):
    """Stream setpoints; return how many were refused, and why the last one was."""
    times = [begin + k * period for k in range(round((end - begin) / period))]
    refusals = [gate.refusal(time, is_zero) for time in times]
    return sum(map(bool, refusals)), refusals[-1]


@pytest.fixture
def lost():
    """Return a gate whose link was lost and is back at 2 s, while a node streams."""
    gate = SetpointGate()
    assert stream(gate, 0.0, 1.0) == (0, "")
    gate.handle(GateEvent.LINK_LOST)
    assert stream(gate, 1.0, 2.0) == (50, "the link is lost")
    gate.handle(GateEvent.LINK_BACK)
    return gate


def test_what_was_streamed_before_a_loss_stays_blocked(lost):
    count, why = stream(lost, 2.0, 60.0)
    assert count == 2900
    assert why.startswith("the link was lost, and the vehicle does not fly")
    assert lost.is_blocking(60.0)
    assert not lost.is_blocking(62.0)


@pytest.mark.parametrize("event", [GateEvent.FLIGHT_REPORTED, GateEvent.FLIGHT_CALLED])
def test_a_flight_that_goes_on_and_a_call_open_it(lost, event):
    lost.handle(event)
    assert stream(lost, 2.0, 3.0) == (0, "")


@pytest.fixture
def standing():
    """Return a gate whose vehicle has not lifted off at 2 s, while a node streams."""
    gate = SetpointGate()
    assert stream(gate, 0.0, 2.0) == (0, "")
    gate.handle(GateEvent.NOT_LIFTED)
    return gate


def test_what_was_streamed_while_a_vehicle_did_not_lift_off_stays_blocked(standing):
    # Its motors have run: for 2 s more it says that it flies.
    standing.handle(GateEvent.FLIGHT_REPORTED)
    count, why = stream(standing, 2.0, 60.0)
    assert count == 2900
    assert why.startswith("the vehicle was commanded to fly and did not lift off")


def test_a_new_stream_zero_thrust_and_a_call_are_new_attempts(standing):
    assert stream(standing, 2.0 + STREAM_PAUSE + 0.1, 4.0) == (0, "")
    standing.handle(GateEvent.NOT_LIFTED)
    assert standing.refusal(4.0, True) == ""
    assert stream(standing, 4.02, 5.0) == (0, "")
    standing.handle(GateEvent.NOT_LIFTED)
    standing.handle(GateEvent.FLIGHT_CALLED)
    assert stream(standing, 5.0, 6.0) == (0, "")


def test_a_pause_opens_it(lost):
    assert stream(lost, 2.0, 2.2)[0] == 10
    assert stream(lost, 2.2 + STREAM_PAUSE + 0.1, 4.0) == (0, "")


def test_a_pause_during_the_loss_opens_it():
    gate = SetpointGate()
    stream(gate, 0.0, 1.0)
    gate.handle(GateEvent.LINK_LOST)
    gate.handle(GateEvent.LINK_BACK)
    assert stream(gate, 3.0, 4.0) == (0, "")


def test_zero_thrust_opens_it(lost):
    assert lost.refusal(2.0, True) == ""
    assert stream(lost, 2.02, 3.0) == (0, "")


def test_nothing_opens_it_without_a_link():
    gate = SetpointGate()
    gate.handle(GateEvent.LINK_LOST)
    gate.handle(GateEvent.FLIGHT_CALLED)
    assert gate.refusal(0.0, True) == "the link is lost"
    assert gate.refusal(5.0, False) == "the link is lost"
    gate.handle(GateEvent.LINK_BACK)
    assert gate.refusal(5.1, False)


@pytest.mark.parametrize(
    ("end", "event"),
    [
        (SetpointGate.high_level, "given a high-level command"),
        (SetpointGate.stop, "stopped by cmd_stop"),
    ],
)
def test_a_setpoint_under_way_does_not_follow_the_end_of_a_stream(end, event):
    gate = SetpointGate()
    stream(gate, 0.0, 1.0)
    end(gate, 1.0)
    assert gate.refusal(1.0 + 0.5 * OVERLAP, False) == f"the vehicle was just {event}"
    assert gate.refusal(1.0 + 0.5 * OVERLAP, True) == ""
    assert gate.refusal(1.0 + 1.5 * OVERLAP, False) == ""


def test_an_emergency_and_a_removal_are_for_good(lost):
    lost.handle(GateEvent.REMOVAL)
    lost.handle(GateEvent.FLIGHT_CALLED)
    assert lost.refusal(9.0, True) == "the vehicle is being removed"
    lost.handle(GateEvent.EMERGENCY_STOP)
    assert lost.refusal(19.0, True) == "emergency stop"


class Moment(float):
    """A time (s) at which something happens in another thread, while a gate computes with it."""

    def __new__(cls, value, event):
        moment = super().__new__(cls, value)
        moment.thread = threading.Thread(target=event)
        return moment

    def __sub__(self, other):
        if not self.thread.ident:
            self.thread.start()
            # It may have to wait until the gate has decided.
            self.thread.join(0.2)
        return float(self) - other


def test_a_link_that_is_lost_while_a_setpoint_is_decided_about_blocks_the_stream():
    gate = SetpointGate()
    stream(gate, 0.0, 1.0)
    moment = Moment(1.0, partial(gate.handle, GateEvent.LINK_LOST))
    assert gate.refusal(moment, False) == ""
    moment.thread.join()
    assert gate.refusal(1.02, False) == "the link is lost"
    gate.handle(GateEvent.LINK_BACK)
    assert stream(gate, 1.04, 2.0)[1].startswith("the link was lost")


def test_nothing_changes_while_a_setpoint_is_sent():
    gate = SetpointGate()
    with gate.passing(0.0, False) as refusal:
        assert refusal == ""
        command = threading.Thread(target=gate.high_level, args=(0.0,))
        command.start()
        command.join(0.2)
        assert command.is_alive()
    command.join()
    assert gate.refusal(0.1, False) == "the vehicle was just given a high-level command"


def test_a_command_that_fails_lets_setpoints_pass_but_not_after_another_one():
    gate = SetpointGate()
    stream(gate, 0.0, 1.0)
    gate.resume(gate.high_level(1.0))
    assert gate.refusal(1.0, False) == ""
    first = gate.high_level(1.0)
    gate.high_level(1.0)
    gate.resume(first)
    assert gate.refusal(1.0, False) == "the vehicle was just given a high-level command"


def test_every_event_has_a_transition_and_every_block_a_reason():
    assert set(TRANSITIONS) == set(GateEvent)
    assert list(REASONS) == list(Block)


@given(st.lists(st.sampled_from(GateEvent), max_size=30))
def test_after_an_emergency_or_a_removal_nothing_passes(events):
    """And without a link; whatever comes in whatever order."""
    gate = SetpointGate()
    for event in events:
        gate.handle(event)
    latched = {GateEvent.EMERGENCY_STOP, GateEvent.REMOVAL} & set(events)
    link = [event for event in events if event in (GateEvent.LINK_LOST, GateEvent.LINK_BACK)]
    is_down = bool(link) and link[-1] is GateEvent.LINK_LOST
    battery = [e for e in events if e in (GateEvent.BATTERY_CRITICAL, GateEvent.BATTERY_RECOVERED)]
    is_empty = bool(battery) and battery[-1] is GateEvent.BATTERY_CRITICAL
    for time, is_zero in ((0.0, False), (0.1, True), (5.0, False)):
        assert bool(gate.refusal(time, is_zero)) is bool(latched or is_down or is_empty)


def test_a_stream_that_was_landed_for_its_battery_must_pause():
    """The voltage comes back by itself as soon as the motors rest."""
    gate = SetpointGate()
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
    gate = SetpointGate()
    gate.handle(GateEvent.BATTERY_RECOVERED)
    assert stream(gate, 0.0, 1.0) == (0, "")
