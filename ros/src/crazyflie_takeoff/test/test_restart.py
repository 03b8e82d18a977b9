"""Server or filter dies at any moment of a flight, and another one takes its place.

Every node is in a process of its own; messages without a subscriber are lost.
"""

import itertools

import pytest
from flight_words import thrusts
from takeoff_helpers import BARE, SERVER, HoverNetwork

from crazyflie_msgs.msg import PositionVelocityStateStamped
from crazyflie_utils.refusal import ServiceError

GAP = 1.0
"""How long there is no server or filter, s."""


@pytest.fixture(params=[SERVER, BARE], ids=["height known", "height unknown"])
def network(request):
    """Return a network on the ground."""
    network = HoverNetwork(request.param)
    network.advance(1.5)
    return network


@pytest.fixture
def seeing():
    """Return a network on the ground whose server knows the height."""
    network = HoverNetwork(SERVER)
    network.advance(1.5)
    return network


def restart(network, name, gap=GAP):
    """Kill server or filter, let time pass, start another one."""
    network.kill(name)
    network.advance(gap)
    getattr(network, f"start_{name}")()


def refusal(network, service):
    with pytest.raises(ServiceError) as error:
        network.call(service)
    return str(error.value)


def test_server_on_the_ground(network):
    begun = network.time
    restart(network, "server")
    network.advance(1.2)
    assert network.last("/in_flight_flight_status") == "on_ground"
    assert set(thrusts(network, begun)) == {0.0}
    assert "on the ground" in refusal(network, "/land")
    network.take_off()
    assert network.vehicle.z == pytest.approx(1.0, abs=0.01)


def test_server_on_the_ground_after_a_flight(network):
    """The controller still has a reference, and must not fly there."""
    network.take_off()
    land = network.call("/land")
    network.advance_until(land.done)
    network.advance(1.0)
    begun = network.time
    network.kill("server")
    for _ in range(50):
        network.advance(0.1)
        assert network.vehicle.z == 0.0
    assert len(network.on("/control/lqr", begun)) > 400
    assert set(thrusts(network, begun)) == {0.0}
    network.start_server()
    network.advance(1.2)
    assert network.last("/in_flight_flight_status") == "on_ground"
    network.take_off()


def test_server_in_flight(network):
    network.take_off()
    toggles = len(network.on("/in_flight"))
    begun = network.time
    restart(network, "server")
    for _ in range(50):
        network.advance(0.1)
        assert network.vehicle.z == pytest.approx(1.0, abs=0.01)
    assert network.last("/in_flight_flight_status") == "flying"
    assert thrusts(network, begun, "/control/takeoff") == []
    assert len(network.on("/in_flight")) == toggles
    assert network.on("/ref", begun) == []
    assert "in flight" in refusal(network, "/takeoff")
    land = network.call("/land")
    network.advance_until(land.done)
    network.advance(0.2)
    assert network.vehicle.z == 0.0
    assert thrusts(network, 0.0)[-1] == 0.0


@pytest.mark.parametrize(
    ("moment", "gap"),
    # The last is just when the filter gives up waiting for a controller.
    [*itertools.product([0.02, 0.5, 0.99, 1.2, 3.0, 5.98], [0.3, 3.0]), (0.99, 2.01)],
)
def test_server_during_takeoff_when_the_height_is_known(seeing, moment, gap):
    """An interrupted manoeuvre ends on the ground, as softly as a landing."""
    seeing.call("/takeoff")
    seeing.advance(moment)
    begun = seeing.time
    restart(seeing, "server", gap)
    seeing.advance_until(lambda: seeing.on("/in_flight_flight_status", begun) != [])
    seeing.advance_until(lambda: seeing.last("/in_flight_flight_status") == "on_ground")
    seeing.advance(0.5)
    assert seeing.vehicle.z == 0.0
    # Long after the server's death the vehicle may have fallen by itself.
    if gap < 1.0 or moment > 1.0:
        assert seeing.vehicle.touchdown_speed < 0.5
    assert len(seeing.on("/in_flight")) in (0, 2)
    # Also when no server has sent a reference, so that the controller was silent.
    seeing.take_off()


@pytest.mark.parametrize("moment", [1.2, 3.0, 5.98])
def test_server_during_takeoff_when_the_height_is_unknown(moment):
    """The controller keeps the vehicle; no node drops it."""
    network = HoverNetwork(BARE)
    network.advance(1.5)
    network.call("/takeoff")
    network.advance(moment)
    begun = network.time
    restart(network, "server")
    network.advance(6.0)
    assert network.last("/in_flight_flight_status") == "flying"
    assert thrusts(network, begun, "/control/takeoff") == []
    assert network.vehicle.z == pytest.approx(1.0, abs=0.01)
    assert len(network.on("/in_flight")) == 1
    land = network.call("/land")
    network.advance_until(land.done)
    network.advance(0.2)
    assert network.vehicle.z == 0.0
    assert len(network.on("/in_flight")) == 2


@pytest.mark.parametrize("gap", [0.1, 3.0])
@pytest.mark.parametrize("moment", [0.02, 1.0, 3.0, 3.25, 3.6, 4.1])
def test_server_during_landing_when_the_height_is_known(seeing, moment, gap):
    seeing.take_off()
    seeing.call("/land")
    seeing.advance(moment)
    begun = seeing.time
    restart(seeing, "server", gap)
    seeing.advance_until(lambda: seeing.on("/in_flight_flight_status", begun) != [])
    seeing.advance_until(lambda: seeing.last("/in_flight_flight_status") == "on_ground")
    seeing.advance(0.5)
    assert seeing.vehicle.z == 0.0
    assert 0.0 < seeing.vehicle.touchdown_speed < 0.5
    assert len(seeing.on("/in_flight")) == 2
    seeing.take_off()


@pytest.mark.parametrize("ground", [-0.4, 0.7])
@pytest.mark.parametrize("moment", [0.5, 2.0, 4.0, 4.9])
def test_server_during_landing_where_the_ground_is_not_at_zero(seeing, ground, moment):
    """Only the former server knew where the vehicle took off."""
    seeing.vehicle_node.offset = ground
    seeing.advance(0.5)
    seeing.take_off()
    assert seeing.vehicle.z == pytest.approx(1.0 - ground, abs=0.02)
    begun = seeing.time
    seeing.call("/land")
    seeing.advance(moment * (1.0 - ground) / 1.4)
    restart(seeing, "server", 0.1)
    seeing.advance_until(lambda: seeing.last("/in_flight_flight_status") == "on_ground")
    assert seeing.time - begun < (1.0 - ground) / 0.3 + 3.0
    seeing.advance(0.5)
    assert seeing.vehicle.z == 0.0
    assert 0.0 < seeing.vehicle.touchdown_speed < 0.5


@pytest.mark.parametrize("ground", [-0.4, 0.7])
def test_server_in_flight_where_the_ground_is_not_at_zero(seeing, ground):
    seeing.vehicle_node.offset = ground
    seeing.advance(0.5)
    seeing.take_off()
    restart(seeing, "server")
    seeing.advance(2.0)
    land = seeing.call("/land")
    begun = seeing.time
    seeing.advance_until(land.done)
    assert seeing.time - begun < (1.0 - ground) / 0.3 + 3.0
    seeing.advance(0.5)
    assert seeing.vehicle.z == 0.0
    assert 0.0 < seeing.vehicle.touchdown_speed < 0.5


def test_a_ground_of_an_earlier_launch_does_not_make_a_vehicle_fly(seeing):
    """The parameter server may be older than server and filter."""
    seeing.vehicle_node.offset = -0.4
    seeing.advance(0.5)
    seeing.take_off()
    seeing.advance_until(seeing.call("/land").done)
    seeing.kill("server")
    seeing.kill("filter")
    seeing.vehicle_node.offset = 0.0
    seeing.advance(3.0)
    seeing.start_server()
    seeing.advance(3.0)
    assert seeing.last("/in_flight_flight_status") == "on_ground"


def test_server_during_the_ramp_when_the_height_is_unknown():
    """The filter gives the vehicle to the controller, the server leaves it there."""
    network = HoverNetwork(BARE)
    network.advance(1.5)
    network.take_off()
    network.call("/land")
    network.advance(0.3)
    begun = network.time
    restart(network, "server")
    network.advance(6.0)
    assert network.last("/in_flight_flight_status") == "flying"
    assert thrusts(network, begun, "/control/takeoff") == []
    assert network.vehicle.z == pytest.approx(1.0, abs=0.01)
    land = network.call("/land")
    network.advance_until(land.done)


@pytest.mark.parametrize("gap", [0.05, 0.4])
def test_filter_in_flight(network, gap):
    network.take_off()
    restart(network, "filter", gap)
    begun = network.time
    network.advance(0.05)
    # At once: the flight state is latched.
    assert len(thrusts(network, begun)) >= 4
    network.advance(5.0)
    assert network.vehicle.z == pytest.approx(1.0, abs=0.01)
    assert network.last("/in_flight_filter_status") == "flying"
    land = network.call("/land")
    network.advance_until(land.done)
    network.advance(1.0)
    assert network.vehicle.z == 0.0
    assert network.vehicle.touchdown_speed < 0.5 or network.server_parameters is BARE


def test_filter_on_the_ground(network):
    network.take_off()
    land = network.call("/land")
    network.advance_until(land.done)
    network.advance(1.0)
    restart(network, "filter")
    begun = network.time
    network.advance(3.0)
    # Not a single one of the controller's commands.
    assert len(network.on("/control/lqr", begun)) > 250
    assert set(thrusts(network, begun)) == {0.0}
    network.take_off()
    assert network.vehicle.z == pytest.approx(1.0, abs=0.01)


def test_filter_during_takeoff_and_landing(network):
    takeoff = network.call("/takeoff")
    for _ in range(5):
        network.advance(1.0)
        restart(network, "filter", 0.1)
    network.advance_until(takeoff.done)
    assert network.vehicle.z == pytest.approx(1.0, abs=0.05)
    land = network.call("/land")
    while not land.done():
        network.advance(0.7)
        restart(network, "filter", 0.1)
    network.advance(1.0)
    assert network.vehicle.z == 0.0
    assert thrusts(network, 0.0)[-1] == 0.0


def test_both_at_once_are_a_fresh_launch(seeing):
    """No node remembers the flight: a vehicle on a table must not take off by its height."""
    seeing.take_off()
    begun = seeing.time
    seeing.kill("server")
    seeing.kill("filter")
    seeing.advance(0.3)
    seeing.start_filter()
    seeing.start_server()
    seeing.advance(2.0)
    assert seeing.last("/in_flight_flight_status") == "on_ground"
    assert set(thrusts(seeing, begun)) == {0.0}


def test_on_a_table_at_launch_with_a_reference():
    """A controller that is told at once where to go does not lift the vehicle off."""
    network = HoverNetwork(SERVER)
    network.vehicle_node.offset = 0.7
    reference = PositionVelocityStateStamped()
    reference.state.z = 1.5
    network.process("controller").publish("/ref", reference)
    network.advance(5.0)
    assert network.last("/in_flight_flight_status") == "on_ground"
    assert len(network.on("/control/lqr")) > 400
    assert set(thrusts(network, 0.0)) == {0.0}


@pytest.mark.parametrize("height", [0.0, 0.7])
def test_no_takeoff_server_yet_with_a_reference(height):
    """The filter waits for one: a vehicle at launch rose to its reference, and fell from there."""
    network = HoverNetwork(SERVER)
    network.kill("server")
    network.kill("filter")
    network.vehicle_node.offset = height
    reference = PositionVelocityStateStamped()
    reference.state.z = 1.5
    network.process("controller").publish("/ref", reference)
    network.start_filter()
    network.advance(3.0)
    assert len(network.on("/control/lqr")) > 200
    assert network.on("/control/final") == []
    network.start_server()
    network.advance(2.0)
    assert set(thrusts(network, 0.0)) == {0.0}
    network.take_off()


def test_a_filter_that_is_restarted_without_a_server_lifts_nothing():
    """The controller still has the reference of the last flight."""
    network = HoverNetwork(SERVER)
    network.take_off()
    network.call("/emergency")
    network.kill("server")
    network.advance(1.0)
    network.kill("filter")
    network.start_filter()
    begun = network.time
    network.advance(3.0)
    assert len(network.on("/control/lqr", begun)) > 200
    assert network.on("/control/final", begun) == []


def test_a_filter_that_starts_after_the_server_lifts_nothing_from_a_table():
    """Without a filter the server took the height for a flight, and the motors began to turn."""
    network = HoverNetwork(SERVER)
    for name in ("server", "filter"):
        network.kill(name)
    network.vehicle_node.offset = 0.7
    network.start_server()
    network.advance(2.0)
    assert network.last("/in_flight_flight_status") == "flying"
    reference = PositionVelocityStateStamped()
    reference.state.z = 1.5
    network.process("controller").publish("/ref", reference)
    network.start_filter()
    network.advance(0.1)
    begun = network.time
    network.advance(2.0)
    assert network.last("/in_flight_flight_status") == "on_ground"
    assert set(thrusts(network, begun)) == {0.0}
    assert network.vehicle.z < 0.01


def test_a_first_state_that_comes_last_lifts_nothing():
    """The server waits for it, too, and has not sent zero thrust yet."""
    network = HoverNetwork(SERVER)
    for name in ("server", "filter"):
        network.kill(name)
    network.vehicle_node.sees = False
    network.start_filter()
    network.advance(2.5)
    reference = PositionVelocityStateStamped()
    reference.state.z = 1.5
    network.process("controller").publish("/ref", reference)
    network.start_server()
    network.advance(0.6)
    network.vehicle_node.sees = True
    network.advance(2.0)
    assert set(thrusts(network, 0.0)) == {0.0}
