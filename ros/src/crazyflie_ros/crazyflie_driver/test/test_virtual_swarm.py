"""Services for all vehicles on virtual ones, which answer a broadcast as the firmware does."""

import contextlib

import pytest
from genpy import Duration
from geometry_msgs.msg import Point

from crazyflie_driver.srv import GoToRequest, LandRequest, TakeoffRequest
from crazyflie_link.broadcast import REPEATS
from crazyflie_utils.testing.programs import wait_until
from crazyflie_virtual.testing import virtual_vehicle

ALL = "/crazyflie_server/all/"
VEHICLES = 3


@pytest.fixture
def swarm(server):
    """Return a server, and the firmwares of its vehicles."""
    with contextlib.ExitStack() as stack:
        firmwares = []
        for number in range(VEHICLES):
            vehicle, uri = stack.enter_context(virtual_vehicle(init_y=float(number)))
            server.add(uri, f"cf{number}")
            firmwares.append(vehicle.vehicle.board.firmware)
        yield server, firmwares


def wait_for_heights(firmwares, low, high):
    wait_until(lambda: all(low < firmware.estimate.z < high for firmware in firmwares))


def test_a_flight_of_all(swarm):
    server, firmwares = swarm

    def received():
        return [firmware.link_statistics.received_broadcasts for firmware in firmwares]

    server.call(ALL + "takeoff", TakeoffRequest(0, 0.5, Duration(1)))
    wait_until(lambda: received() == [REPEATS] * VEHICLES)
    wait_for_heights(firmwares, 0.4, 0.7)
    server.call(ALL + "go_to", GoToRequest(0, True, Point(0.0, 0.0, 0.3), 0.0, Duration(1)))
    wait_until(lambda: received() == [2 * REPEATS] * VEHICLES)
    # Repeated, it is the same goal.
    wait_for_heights(firmwares, 0.7, 0.9)
    wait_until(lambda: all(each.planner.is_finished(each.time) for each in firmwares))
    assert all(abs(each.setpoint.z - 0.8) < 0.02 for each in firmwares)
    server.call(ALL + "land", LandRequest(0, 0.0, Duration(1)))
    wait_for_heights(firmwares, -0.1, 0.1)
    assert received() == [3 * REPEATS] * VEHICLES
