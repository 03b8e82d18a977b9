"""The emergency stop of a vehicle whose link is silent, or only being set up."""

import pytest
from safety_helpers import LOCKED, READY, is_, said, wait_for_words
from std_msgs.msg import Empty
from std_srvs.srv import EmptyRequest

from crazyflie_utils import ServiceError
from crazyflie_utils.testing.peer import wait_until

LIMIT = 60.0
EMERGENCY_WORDS = "emergency stop: remove, restart and add the vehicle"


def test_an_emergency_does_not_wait_for_tables(server):
    vehicle = server.make_vehicle()
    vehicle.deaf.add((5, 0, b""))
    adding = server.begin_adding(vehicle.uri)
    vehicle.wait_for_packets(5, 0)
    server.process.publish("/all/emergency", Empty())
    vehicle.wait_for_packets(9, 1)
    assert not adding.done()
    is_(vehicle, LOCKED)
    vehicle.deaf.clear()
    adding.result(timeout=LIMIT)
    assert vehicle.packets(3, 0) == []
    assert said(server) == EMERGENCY_WORDS


def test_an_emergency_does_not_wait_for_the_tables_of_a_new_link(server, vehicle):
    vehicle.is_frozen = True
    wait_for_words(server, "lost")
    with pytest.raises(ServiceError, match="is sent when the link is back"):
        server.call("/cf1/emergency", EmptyRequest())
    crazyflie = server.node._vehicles[vehicle.uri].crazyflie
    wait_until(lambda: crazyflie._opening is not None, "a new attempt to connect")
    vehicle.deaf.add((5, 0, b""))
    vehicle.received.clear()
    vehicle.is_frozen = False
    vehicle.wait_for_packets(9, 1)
    assert vehicle.packets(3, 0) == []


def test_a_removal_waits_for_the_emergency_stop(server, vehicle):
    is_(vehicle, READY)
    server.call("/cf1/emergency", EmptyRequest())
    vehicle.wait_for_packets(9, 1, 3)
    with pytest.raises(ServiceError, match="is removed, but the emergency stop is not confirmed"):
        server.remove(vehicle.uri)


def test_an_emergency_that_was_obeyed_is_a_removal_as_any_other(server, vehicle):
    is_(vehicle, LOCKED)
    server.call("/cf1/emergency", EmptyRequest())
    server.remove(vehicle.uri)
    assert vehicle.packets(3, 0) == []
