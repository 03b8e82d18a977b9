"""A vehicle that is switched on after the driver has begun to look for it, and who is told."""

import pytest
from conftest import LIMIT
from safety_helpers import wait_for_words
from std_msgs.msg import Bool

from crazyflie_utils import ServiceError
from crazyflie_utils.testing.programs import free_port, wait_until


def connected(server):
    return [message.data for message in server.process.published("/cf1/connected")]


def test_a_vehicle_that_is_switched_on_later_is_waited_for(server):
    port = free_port()
    answer = server.begin_adding(f"udp://127.0.0.1:{port}")
    wait_for_words(server, "nothing listens on this port")
    server.make_vehicle(port=port)
    answer.result(timeout=LIMIT)


def test_a_vehicle_that_was_given_up_can_be_added_when_it_is_there(make_server):
    server = make_server({"connect/limit": 0.0})
    port = free_port()
    uri = f"udp://127.0.0.1:{port}"
    with pytest.raises(ServiceError):
        server.add(uri)
    assert connected(server) == [False]
    server.make_vehicle(port=port)
    server.add(uri)
    wait_until(lambda: connected(server)[-1], "the topic connected")


def test_whether_a_vehicle_is_connected_is_published(server):
    vehicle = server.make_vehicle()
    answer = server.begin_adding(vehicle.uri)
    assert connected(server) == [False]
    answer.result(timeout=LIMIT)
    wait_until(lambda: connected(server)[-1], "the topic connected")
    assert connected(server) == [False, True]
    # Again and again, so that a driver that has died is noticed.
    server.process.advance(2.5)
    assert connected(server)[1:] == [True] * len(connected(server)[1:])
    assert len(connected(server)) >= 4
    vehicle.is_frozen = True
    wait_for_words(server, "lost")
    assert connected(server)[-1] is False
    vehicle.is_frozen = False
    wait_until(lambda: connected(server)[-1], "the topic connected")


def test_a_vehicle_that_is_removed_is_no_longer_connected(server):
    vehicle = server.make_vehicle()
    server.add(vehicle.uri)
    wait_until(lambda: connected(server)[-1], "the topic connected")
    server.remove(vehicle.uri)
    assert server.process.published("/cf1/connected")[-1] == Bool(False)
