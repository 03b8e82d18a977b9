"""Server or filter with another implementation, which has only the toggle."""

import pytest
from flight_words import texts
from std_msgs.msg import Empty
from takeoff_helpers import BARE, FILTER, SERVER, HoverNetwork, Network, control, state

from crazyflie_msgs.msg import FlightStatus, PositionVelocityStateStamped
from crazyflie_takeoff.takeoff_control_filter_node import (
    FRESH_TIME,
    LISTENING_TIME,
    TakeoffControlFilterNode,
)
from crazyflie_takeoff.takeoff_server_node import TakeoffServerNode


def test_server_with_a_foreign_filter_in_flight():
    """Without a memory, the height decides; it takes a second."""
    network = Network()
    network.start("server", TakeoffServerNode(), SERVER)
    for _ in range(150):
        network.process("server").publish("/state", state(1.0))
        network.advance(0.01)
    assert network.last("/in_flight_flight_status") == "flying"
    assert network.on("/control/takeoff") == []
    assert network.on("/in_flight_flight_status")[0][0] == pytest.approx(101.0, abs=0.03)


def test_filter_with_a_foreign_server():
    """Toggles alone decide, and a restart in flight costs the time of listening."""
    network = Network()
    network.start("filter", TakeoffControlFilterNode(), FILTER)
    process = network.process("filter")
    for _ in range(50):
        process.publish("/control/lqr", control(9.0))
        network.advance(0.01)
    first = network.on("/control/final")[0][0]
    assert first == pytest.approx(100.0 + LISTENING_TIME, abs=0.02)
    process.publish("/in_flight", Empty())
    network.advance(0.01)
    assert network.last("/in_flight_filter_status") == "flying"
    process.publish("/in_flight", Empty())
    network.advance(0.01)
    assert network.last("/in_flight_filter_status") == "unknown"
    network.advance(FRESH_TIME)
    assert network.last("/in_flight_filter_status") == "commanded"


def test_server_takes_the_place_of_a_foreign_one_in_flight():
    """The filter knows from the toggle that the vehicle flies."""
    network = HoverNetwork(BARE)
    network.vehicle_node.offset = 1.0
    network.kill("server")
    network.kill("filter")
    network.start_filter()
    network.process("filter").publish("/in_flight", Empty())
    network.process("controller").publish("/ref", PositionVelocityStateStamped())
    network.start_server()
    network.advance(2.0)
    assert network.last("/in_flight_flight_status") == "flying"
    assert network.on("/in_flight") == []


def test_a_dead_servers_flight_state_is_not_news():
    network = HoverNetwork(BARE)
    network.advance(1.5)
    network.kill("server")
    status = FlightStatus(state=FlightStatus.ON_GROUND)
    network.process("filter").publish("/in_flight_flight_status", status)
    network.advance(1.0)
    assert texts(m for _, m in network.on("/in_flight_filter_status")) == ["unknown", "on_ground"]
