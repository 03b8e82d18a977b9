"""The log of a flight."""

import pytest
from flight_words import until_on_ground
from std_msgs.msg import Empty
from takeoff_helpers import SERVER, ControllerNode, HoverNetwork

PROCESSES = ("vehicle", "controller", "filter", "server")


def said(network, level, *names):
    """Return what was logged by some processes, without the names of the nodes."""
    logs = (network.process(name).logged(level) for name in names)
    return [text.partition(": ")[2] for log in logs for text in log]


def test_an_ordinary_flight_logs_each_state_once():
    network = HoverNetwork(SERVER)
    network.advance(1.0)
    for _ in range(2):
        network.take_off()
        network.call("/land")
        until_on_ground(network)
    begin, *flights = said(network, "info", *PROCESSES)
    assert begin.startswith("begins on_ground")
    assert flights == ["taking off", "flying", "landing", "on the ground"] * 2
    assert said(network, "warn", *PROCESSES) == []


def test_a_lost_controller_is_logged_once_and_is_no_matter_of_the_next_flight(network):
    before = len(said(network, "info", "server"))
    network.kill("controller")
    until_on_ground(network)
    warnings = said(network, "warn", "filter", "server")
    assert [text.split()[0] for text in warnings] == ["flying:", "sinking", "down"]
    network.start("controller", ControllerNode())
    network.take_off()
    network.call("/land")
    until_on_ground(network)
    assert said(network, "warn", "filter", "server") == warnings
    landing, ground, *flight = said(network, "info", "server")[before:]
    assert (landing, ground) == ("landing", "on the ground")
    assert flight == ["taking off", "flying", "landing", "on the ground"]
    assert network.last("/in_flight_status") == "on ground"


def test_a_reason_is_logged_once(network):
    before = len(said(network, "info", "server"))
    network.server.prepare_shutdown()
    until_on_ground(network)
    assert said(network, "info", "server")[before:] == [
        "landing: the launch is to end",
        "on the ground",
    ]


def test_what_the_filter_does_is_explained_by_the_filter_only(network):
    before = len(said(network, "info", "server"))
    network.process("filter").publish("/all/emergency", Empty())
    network.advance(0.5)
    assert said(network, "info", "server")[before:] == ["on the ground"]
    assert said(network, "warn", "filter") == ["emergency from flying: all vehicles were stopped"]
    assert "all vehicles were stopped" in network.last("/in_flight_status")


@pytest.mark.parametrize("gap", [0.5, 1.5])
def test_a_server_that_takes_over_does_not_repeat_its_state(network, gap):
    network.kill("server")
    network.advance(gap)
    network.start_server()
    network.advance(2.0)
    (begin,) = said(network, "info", "server")
    assert begin.startswith("begins flying")
