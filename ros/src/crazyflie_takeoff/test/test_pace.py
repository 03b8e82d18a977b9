"""Server and filter look after a flight less often while all is well, and are quick when not."""

import sys
from unittest import mock

import lone_server
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from flight_words import thrusts
from takeoff_helpers import FILTER, GRAVITY, SERVER, HoverNetwork, control

from crazyflie_msgs.msg import EstimateStatus, FlightStatus
from crazyflie_takeoff import flight_topics, supervisor
from crazyflie_takeoff.server_table import FlightStateMachine
from crazyflie_takeoff.supervisor import Given
from crazyflie_takeoff.takeoff_control_filter_node import TakeoffControlFilterNode
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.topics import Publisher


@pytest.fixture(params=range(5))
def moment(request, network):
    """Return a flight at some moment between two looks."""
    network.advance(0.5 + 0.01 * request.param)
    return network


def ticks(owner, run):
    """Return how often time passes for a part of a node in a run."""
    name = "step" if owner is supervisor else "tick"
    original = getattr(owner, name)
    with mock.patch.object(owner, name, autospec=True, side_effect=original) as tick:
        run()
    return sum(owner is not supervisor or call.args[2] is Given.TIME for call in tick.mock_calls)


def count(network, owner, duration=2.0):
    """Return how often time passes for a part of a node in a second."""
    return ticks(owner, lambda: network.advance(duration)) / duration


def test_in_flight_there_is_little_to_do(network):
    network.advance(0.5)
    assert count(network, FlightStateMachine) == pytest.approx(10, abs=1)
    assert count(network, supervisor) == pytest.approx(25, abs=1)
    network.call("/land")
    network.advance(0.1)
    assert count(network, FlightStateMachine, 1.0) == pytest.approx(100, abs=1)


def test_a_nominal_control_costs_a_few_calls(network):
    """Counts what Python calls for a control and a tick, where nothing can change."""
    network.advance(1.0)
    node, calls = network.process("filter").node, []

    def note(frame, event, _):
        if event == "call" and frame.f_globals["__name__"].startswith("crazyflie_takeoff."):
            calls.append(frame.f_code.co_name)

    def counted(run):
        calls.clear()
        sys.setprofile(note)
        try:
            run()
        finally:
            sys.setprofile(None)
        return len(calls)

    message = network.on("/control/lqr")[-1][1]
    message._connection_header = node._connection
    assert counted(lambda: node._on_commanded_control(message)) <= 6
    network.advance(0.04)
    assert counted(node._on_timer) <= 24


def test_diagnostics_that_nobody_receives_are_not_made(network):
    with mock.patch.object(flight_topics, "report", autospec=True) as report:
        with mock.patch.object(Publisher, "has_subscribers", return_value=False):
            network.advance(2.5)
        assert report.call_count == 0
        report.side_effect = lambda *_: DiagnosticArray()
        network.advance(1.5)
        assert report.call_count >= 2


def test_a_landing_begins_at_once(moment):
    called = moment.time
    moment.call("/land")
    moment.advance(0.02)
    assert moment.on("/ref_descent", called)


def test_a_lost_control_is_noticed_in_time(moment):
    moment.vehicle_node.sees = False
    last = moment.on("/control/lqr")[-1][0]
    moment.advance(0.3)
    taken_over = moment.on("/control/final", last)[0][0]
    # First it fades what was passed on last.
    assert 0.05 < taken_over - last < 0.1
    assert "no control comes" in moment.last("/in_flight_filter_status")
    # After that, every 10 ms.
    assert (
        len(moment.on("/control/final", taken_over)) >= round((moment.time - taken_over) * 100) - 1
    )


def test_a_filter_that_is_to_hold_after_less_is_quicker(network):
    filters = {**FILTER, "topics/state": "/state", "loss/hold_after": 0.03}
    network.start("filter", TakeoffControlFilterNode(), filters)
    network.advance(1.0)
    network.vehicle_node.sees = False
    network.advance(0.045)
    assert "no control comes" in network.last("/in_flight_filter_status")


def test_a_vehicle_that_tilts_over_is_stopped_at_once(moment):
    tilted = moment.time
    moment.process("filter").publish("/state_status", EstimateStatus(is_tilted=True))
    moment.advance(0.02)
    assert thrusts(moment, tilted)[-1] == 0.0


def test_one_that_is_below_the_ground_is_stopped_in_time(moment):
    wrong = moment.time
    moment.vehicle_node.offset = -2.0
    moment.advance(0.18)
    assert thrusts(moment, wrong)[-1] == 0.0


@pytest.mark.parametrize(("hold", "rate"), [(0.2, 25), (0.05, 50), (0.01, 83)])
def test_the_filter_looks_more_often_than_a_control_is_lost(hold, rate):
    process = FakeProcess()
    parameters = {**FILTER, "loss/hold_after": hold}
    assert process.launch(TakeoffControlFilterNode(), "/filter", parameters)
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))

    def fly():
        for _ in range(200):
            process.publish("/control/lqr", control(GRAVITY))
            process.advance(0.005)

    fly()
    assert ticks(supervisor, fly) == pytest.approx(rate, abs=1)


def test_the_server_has_little_to_do_in_flight_and_on_the_ground():
    process = lone_server.flying()
    process.advance(0.1)
    assert count(process, FlightStateMachine) == pytest.approx(10, abs=1)
    assert count(lone_server.on_ground(), FlightStateMachine) == pytest.approx(20, abs=1)


def test_so_has_the_filter_on_the_ground_and_in_a_takeoff():
    network = HoverNetwork(SERVER)
    network.advance(1.0)
    assert count(network, supervisor, 1.0) == pytest.approx(25, abs=1)
    network.call("/takeoff")
    network.advance(0.1)
    assert count(network, supervisor, 0.5) == pytest.approx(25, abs=2)
