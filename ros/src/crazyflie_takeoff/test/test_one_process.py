"""Server, filter, controller and vehicle in one fake process: a whole flight."""

import pytest
from std_srvs.srv import EmptyRequest
from takeoff_helpers import BARE, FILTER, SERVER, ControllerNode, VehicleNode

from crazyflie_takeoff.takeoff_control_filter_node import TakeoffControlFilterNode
from crazyflie_takeoff.takeoff_server_node import TakeoffServerNode
from crazyflie_utils.testing import FakeProcess

NODES = ("/server", "/filter", "/controller", "/vehicle")


def launch(order, server):
    """Return a process with all nodes, initialized in an order, and its vehicle."""
    process = FakeProcess()
    vehicle_node = VehicleNode()
    nodes = {
        "/server": (TakeoffServerNode(), server),
        "/filter": (TakeoffControlFilterNode(), FILTER),
        "/controller": (ControllerNode(), {}),
        "/vehicle": (vehicle_node, {}),
    }
    for name in order:
        assert process.launch(nodes[name][0], name, nodes[name][1])
    return process, vehicle_node.vehicle


@pytest.mark.parametrize("order", [NODES, NODES[::-1]])
def test_takes_off_hovers_and_lands(order):
    process, vehicle = launch(order, SERVER)
    # A call in the very first moment has to wait, but not long.
    takeoff = process.call("/takeoff", EmptyRequest())
    process.advance(6.2)
    assert takeoff.done()
    assert takeoff.exception() is None
    for _ in range(50):
        process.advance(0.1)
        assert vehicle.z == pytest.approx(1.0, abs=0.01)
    land = process.call("/land", EmptyRequest())
    for _ in range(100):
        process.advance(0.1)
        if land.done():
            break
    assert land.exception(timeout=0) is None
    assert vehicle.z == 0.0
    assert 0.0 < vehicle.touchdown_speed < 0.5
    assert process.published("/control/final")[-1].control.thrust == 0.0
    process.advance(2.0)
    assert vehicle.z == 0.0
    assert len(process.published("/in_flight")) == 2
    assert process.logged("error") == []


def test_no_zero_thrust_reaches_a_vehicle_in_the_air():
    process, vehicle = launch(NODES, SERVER)
    process.advance(0.5)
    takeoff = process.call("/takeoff", EmptyRequest())
    land = None
    checked = 0
    for _ in range(1500):
        before = len(process.published("/control/final"))
        process.advance(0.01)
        if vehicle.z > 0.05:
            controls = process.published("/control/final")[before:]
            assert all(message.control.thrust > 0.0 for message in controls)
            checked += len(controls)
        if takeoff.done() and land is None:
            land = process.call("/land", EmptyRequest())
    assert land.exception(timeout=0) is None
    assert checked > 500


def test_a_controller_that_connects_late_gets_the_reference():
    process, vehicle = launch(("/server", "/filter", "/vehicle"), BARE)
    process.advance(1.5)
    process.call("/takeoff", EmptyRequest())
    process.advance(1.3)
    assert len(process.published("/ref")) == 1
    assert process.launch(ControllerNode(), "/controller")
    process.advance(5.0)
    assert vehicle.z == pytest.approx(1.0, abs=0.01)
