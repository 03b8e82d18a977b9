"""After a touchdown FLYING is reported for 2 s more: nothing may start the motors again."""

import pytest
from safety_helpers import HIGH_LEVEL, LAND, TAKEOFF, is_, wait_for_words

from crazyflie_model.supervisor import SupervisorState
from crazyflie_utils.testing.programs import wait_until

pytestmark = pytest.mark.filterwarnings("ignore:The supervisor subsystem:UserWarning")


def logged(server, vehicle):
    """Return the state that the driver knows."""
    return server.node._vehicles[vehicle.uri].log.supervisor


def wait_for_log(server, vehicle):
    """Wait until the driver knows the present state; time stands still."""
    wait_until(lambda: logged(server, vehicle) == vehicle.flight.state, "the log")


# Firmware before protocol 12 reports FLYING only.
@pytest.fixture(params=[12, 11])
def landed(request, server):
    """Return a server and a vehicle that has touched down, and still reports that it flies."""
    vehicle = server.make_vehicle(protocol=request.param)
    server.add(vehicle.uri)
    vehicle.wait_for_packets(7, 1)
    server.call("/cf1/takeoff", TAKEOFF)
    wait_for_log(server, vehicle)
    server.process.advance(3.0)
    assert server.process.published("/flights")[-1].data == "/crazyflie_server in flight"
    server.call("/cf1/land", LAND)
    server.process.advance(2.5)
    assert not vehicle.flight.motors_run
    assert SupervisorState.FLYING in vehicle.flight.state
    wait_for_log(server, vehicle)
    return server, vehicle


def assert_rests(vehicle):
    """Assert that the motors have run once, and were told to land once."""
    assert vehicle.flight.starts == 1
    assert [data[0] for data in vehicle.packets(8, 0)] == [7, 8]


def test_ctrl_c(landed):
    server, vehicle = landed
    server.process.advance(0.2)
    assert server.process.published("/flights")[-1].data == "/crazyflie_server on ground"
    server.node.prepare_shutdown()
    server.process.advance(0.5)
    server.node.shutdown()
    assert_rests(vehicle)


def test_removal(landed):
    server, vehicle = landed
    server.remove(vehicle.uri)
    assert_rests(vehicle)


def test_battery(landed):
    server, vehicle = landed
    vehicle.log["pm.vbat"] = ("f", 2.0)
    crazyflie = server.node._vehicles[vehicle.uri]
    crazyflie.log.battery._time = 0.0
    wait_until(lambda: "critical" in crazyflie.log.battery.words(), "the battery")
    vehicle.wait_for_packets(15, 0, len(vehicle.packets(15, 0)) + 3)
    assert_rests(vehicle)


def test_the_service(landed):
    server, vehicle = landed
    server.call("/cf1/land", LAND)
    assert "land is not sent, the vehicle is on the ground" in server.process.logged("info")[-1]
    assert_rests(vehicle)


def test_a_landing_right_after_a_takeoff_is_sent(server, vehicle):
    """The firmware reports what its planner does up to 40 ms later."""
    is_(vehicle, 0x20E)
    server.call("/cf1/takeoff", TAKEOFF)
    is_(vehicle, 0x20E)
    server.call("/cf1/land", LAND)
    assert [data[0] for data in vehicle.packets(8, 0)] == [7, 8]


def test_a_removal_during_a_landing_leaves_it_alone(make_server):
    """The firmware refuses to land again, and lands without a link, too."""
    server = make_server({"landing/limit": 0.5})
    vehicle = server.make_vehicle()
    server.add(vehicle.uri)
    vehicle.wait_for_packets(7, 1)
    vehicle.received.clear()
    server.call("/cf1/takeoff", TAKEOFF)
    server.process.advance(3.0)
    server.call("/cf1/land", LAND)
    server.remove(vehicle.uri)
    assert vehicle.packets(3, 0) == []
    assert vehicle.flight.motors_run


def test_a_flight_that_another_client_began_is_landed(server):
    vehicle = server.make_vehicle()
    is_(vehicle, HIGH_LEVEL)
    server.add(vehicle.uri)
    wait_for_words(server, "flying")
    server.node.prepare_shutdown()
    server.process.advance(0.2)
    assert [data[0] for data in vehicle.wait_for_packets(8, 0)] == [8]
