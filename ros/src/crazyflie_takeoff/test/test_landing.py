"""Landings, asked for in a takeoff and at the end of the launch."""

import pytest
from flight_words import states, thrusts, until_on_ground
from std_msgs.msg import String
from takeoff_helpers import SERVER, HoverNetwork, state

from crazyflie_msgs.msg import PositionVelocityStateStamped
from crazyflie_utils.refusal import ServiceError

# Landing.


@pytest.mark.parametrize("moment", [0.3, 1.3, 3.0])
def test_land_aborts_a_takeoff(moment):
    network = HoverNetwork(SERVER)
    network.advance(0.5)
    takeoff = network.call("/takeoff")
    network.advance(moment)
    land = network.call("/land")
    with pytest.raises(ServiceError, match="takeoff aborted: /land was called"):
        takeoff.result(0)
    network.advance_until(land.done)
    assert land.exception() is None
    assert network.vehicle.z == 0.0 or network.vehicle.z < 0.05
    assert network.vehicle.touchdown_speed < 0.5


def test_the_descent_has_a_topic_of_its_own(network):
    network.call("/land")
    begun = network.time
    network.advance(1.0)
    own = [message for _, message in network.on("/ref_descent", begun)]
    shared = [message for _, message in network.on("/ref", begun)]
    assert own == shared
    assert len(own) == pytest.approx(100, abs=2)
    assert isinstance(own[0], PositionVelocityStateStamped)
    until_on_ground(network)
    network.take_off()
    assert network.on("/ref")[-1][0] > network.on("/ref_descent")[-1][0]


@pytest.mark.parametrize("gap", [1.0, 2.5, 10.0])
def test_a_landing_whose_states_do_not_reach_the_server(network, gap):
    """The controller sees, and flies what is asked for."""
    land = network.call("/land")
    network.advance(1.0)
    network.unheard.add(("/server", "/state"))
    network.advance_until(land.done, gap) if gap > 8.0 else network.advance(gap)
    network.unheard.clear()
    network.advance_until(land.done)
    network.advance(0.2)
    assert network.vehicle.z == 0.0
    assert 0.0 < network.vehicle.touchdown_speed < 0.5


def test_a_height_that_is_old_is_no_touchdown(network):
    """Such as one that has waited in a socket: the vehicle stood on the ground then."""
    network.call("/land")
    network.advance(0.5)
    network.unheard.add(("/server", "/state"))
    server = network.process("server")
    for _ in range(100):
        server.publish("/state", state(0.0, stamp=server.clock.stamp(network.time - 2.0)))
        network.advance(0.01)
    assert network.last("/in_flight_flight_status") == "descending"
    network.unheard.clear()
    until_on_ground(network)
    assert 0.0 < network.vehicle.touchdown_speed < 0.5


def test_a_landing_that_begins_while_no_states_reach_the_server(network):
    network.unheard.add(("/server", "/state"))
    network.advance(5.0)
    land = network.call("/land")
    network.advance_until(land.done)
    network.advance(0.2)
    assert network.vehicle.z == 0.0
    assert 0.0 < network.vehicle.touchdown_speed < 0.5


# A ground that is not where the vehicle took off.


def above_a_table(table, height, **parameters):
    """Return a network that has taken off from a table, and flies next to it (heights in m)."""
    network = HoverNetwork({**SERVER, "hover/z": table + 0.5, **parameters})
    network.vehicle.z = network.vehicle.ground = table
    network.take_off()
    reference = PositionVelocityStateStamped()
    reference.state.z = table + height
    network.process("controller").publish("/ref", reference)
    network.advance(3.0)
    network.vehicle.ground = 0.0
    return network


@pytest.mark.parametrize("speed", [0.1, 0.3, 1.0])
@pytest.mark.parametrize("table", [0.15, 0.75, 2.0])
def test_a_vehicle_from_a_table_lands_on_the_floor(table, speed):
    network = above_a_table(table, 0.5, **{"landing/descent_speed": speed})
    land = network.call("/land")
    network.advance_until(land.done, 60.0)
    assert land.exception() is None
    assert network.vehicle.z == 0.0
    assert network.vehicle.touchdown_speed < max(0.6, 1.2 * speed)
    network.advance(0.2)
    assert thrusts(network)[-1] == 0.0
    # From the floor, it is an ordinary landing.
    network.take_off()
    land = network.call("/land")
    network.advance_until(land.done, 60.0)
    assert network.vehicle.touchdown_speed < max(0.6, 1.2 * speed)


@pytest.mark.parametrize("height", [0.03, 0.3, 1.0])
@pytest.mark.parametrize("table", [0.15, 0.75, 2.0])
def test_the_filter_brings_a_vehicle_from_a_table_down_to_the_floor(table, height):
    network = above_a_table(table, height)
    network.kill("controller")
    network.advance_until(lambda: network.last("/in_flight_flight_status") == "on_ground", 60.0)
    assert network.vehicle.z == 0.0
    assert network.vehicle.touchdown_speed < 0.6
    network.advance(0.2)
    assert thrusts(network)[-1] == 0.0


def test_the_filter_brings_the_second_flight_down_as_the_first(network):
    for _ in range(2):
        # The controller does not follow the descent, so the filter lands.
        network.unheard.add(("/controller", "/ref"))
        land = network.call("/land")
        network.advance_until(land.done)
        assert "has not come down" in network.last("/in_flight_status")
        assert 0.2 < network.vehicle.touchdown_speed < 0.6
        network.vehicle.touchdown_speed = 0.0
        network.unheard.clear()
        network.take_off()


@pytest.mark.parametrize("faller", ["server", "filter"])
def test_a_vehicle_that_lands_on_a_table_is_down_there(faller):
    network = HoverNetwork(SERVER)
    network.take_off()
    network.vehicle.ground = 0.75
    begin = network.time
    if faller == "server":
        network.call("/land")
    else:
        network.kill("controller")
    network.advance_until(lambda: network.last("/in_flight_flight_status") == "on_ground")
    assert network.time - begin < 8.0
    assert network.vehicle.z == 0.75
    assert network.vehicle.touchdown_speed < 0.6
    network.advance(0.2)
    assert thrusts(network)[-1] == 0.0


# The end of the launch.


def flights(network):
    return [message.data for _, message in network.on("/flights")]


def test_a_server_that_is_to_leave_lands_first(network):
    assert flights(network)[-1].endswith(" in flight")
    network.server.prepare_shutdown()
    until_on_ground(network)
    assert network.vehicle.touchdown_speed < 0.6
    assert flights(network)[-1].endswith(" on ground")
    assert network.last("/in_flight_status") == "on ground: the launch is to end"


def test_the_end_of_a_node_that_the_flight_needs_is_a_landing(network):
    begin = network.time
    network.process("server").publish("/flights", String("/driver is to end: land"))
    until_on_ground(network)
    assert network.time - begin < 10.0
    assert network.vehicle.z == 0.0
    assert network.vehicle.touchdown_speed < 0.6
    assert network.last("/in_flight_status") == "on ground: /driver is to end"
    # The server goes on.
    network.advance(1.0)
    network.take_off()


def test_from_far_above_a_server_that_is_to_leave_lands_faster():
    network = HoverNetwork({**SERVER, "hover/z": 4.0, "duration/hover": 10.0})
    network.take_off()
    assert network.vehicle.z > 3.9
    begin = network.time
    network.server.prepare_shutdown()
    until_on_ground(network)
    assert network.time - begin < 10.0
    assert network.vehicle.touchdown_speed < 1.0


@pytest.mark.parametrize("moment", [0.02, 1.0, 5.0])
def test_a_server_that_is_to_leave_makes_a_landing_under_way_faster(moment):
    network = HoverNetwork({**SERVER, "hover/z": 4.0, "landing/descent_speed": 0.2})
    network.take_off()
    land = network.call("/land")
    network.advance(moment)
    begin = network.time
    network.server.prepare_shutdown()
    until_on_ground(network)
    assert network.time - begin < 10.0
    assert network.vehicle.z == 0.0
    assert network.vehicle.touchdown_speed < 1.0
    assert land.exception(0) is None


def test_a_server_that_is_to_leave_aborts_a_takeoff():
    network = HoverNetwork(SERVER)
    network.advance(1.0)
    takeoff = network.call("/takeoff")
    network.advance(3.0)
    network.server.prepare_shutdown()
    with pytest.raises(ServiceError, match="takeoff aborted: .* is to end"):
        takeoff.result(timeout=0)
    until_on_ground(network)
    assert network.vehicle.z == 0.0


def test_a_server_that_is_to_leave_does_not_take_off():
    """Its process may wait for the landing of another vehicle, and ends after that."""
    network = HoverNetwork(SERVER)
    network.advance(1.0)
    network.process("server").prepare_shutdown({"/server": network.server})
    network.advance(1.0)
    with pytest.raises(ServiceError, match="/takeoff refused: /server is to end"):
        network.call("/takeoff")
    assert states(network) == ["on_ground"]


def test_on_the_ground_there_is_nothing_to_land():
    network = HoverNetwork(SERVER)
    network.advance(1.0)
    network.server.prepare_shutdown()
    network.advance(1.0)
    assert states(network) == ["on_ground"]
