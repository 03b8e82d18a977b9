"""A vehicle that is switched on after the driver has begun to look for it, and who is told."""

import pytest
from conftest import LIMIT
from safety_helpers import wait_for_words
from std_msgs.msg import Bool

from crazyflie_driver.parameters import CrazyflieServerParameters
from crazyflie_driver.vehicle import connect_within
from crazyflie_link.errors import AddressError, NoAnswerError, NoDongleError, SetupError
from crazyflie_utils import ServiceError
from crazyflie_utils.testing.programs import free_port
from crazyflie_utils.testing.waiting import wait_until

DEFAULT_LIMIT = next(
    each.default
    for each in CrazyflieServerParameters.declarations()
    if each.name == "connect/limit"
)


class Vehicle:
    """A vehicle whose port opens at a moment, and the time that attempts to connect take."""

    def __init__(self, opens_at, error=NoAnswerError):
        self.now = 0.0
        self.attempts = 0
        self._opens_at, self._error = opens_at, error

    def connect(self):
        self.attempts += 1
        if self.now < self._opens_at:
            raise self._error("no answer")

    def sleep(self, duration):
        self.now += duration

    def clock(self):
        return self.now

    def connect_within(self, limit, is_closing=lambda: False):
        connect_within(limit, self.connect, is_closing, self.clock, self.sleep)


def connected(server):
    return [message.data for message in server.process.published("/cf1/connected")]


def test_a_vehicle_that_opens_its_port_5_s_later_is_waited_for():
    vehicle = Vehicle(opens_at=5.0)
    vehicle.connect_within(DEFAULT_LIMIT)
    assert 5.0 <= vehicle.now < 5.5


def test_a_vehicle_that_does_not_come_is_given_up_after_15_s():
    vehicle = Vehicle(opens_at=100.0)
    with pytest.raises(NoAnswerError):
        vehicle.connect_within(DEFAULT_LIMIT)
    assert 15.0 <= vehicle.now < 15.5


@pytest.mark.parametrize("error", [NoDongleError, AddressError, SetupError])
def test_what_waiting_does_not_mend_is_not_tried_again(error):
    vehicle = Vehicle(5.0, error)
    with pytest.raises(error):
        vehicle.connect_within(DEFAULT_LIMIT)
    assert vehicle.attempts == 1


def test_a_removal_ends_the_attempts():
    vehicle = Vehicle(opens_at=5.0)
    with pytest.raises(NoAnswerError):
        vehicle.connect_within(DEFAULT_LIMIT, lambda: vehicle.now > 1.0)
    assert vehicle.now < 1.5


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
