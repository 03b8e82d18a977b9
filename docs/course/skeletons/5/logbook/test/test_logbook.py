"""The logbook, first the algorithm, then the node on a fake process."""

import pytest

from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils import ServiceError
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.testing import FakeProcess
from logbook.logbook import FlightEntry, Logbook
from logbook.logbook_node import LogbookNode
from logbook.srv import GetFlightRequest


def test_a_flight_is_written_down():
    book = Logbook()
    book.begin(10.0)
    for position in ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (3.0, 4.0, 1.0), (3.0, 4.0, 0.0)):
        book.add(position)
    assert book.end(25.0) == FlightEntry(1, duration=15.0, distance=7.0, max_height=1.0)


def test_what_happens_on_the_ground_is_not():
    book = Logbook()
    book.add((0.0, 0.0, 0.0))
    assert book.end(1.0) is None
    book.begin(2.0)
    book.add((5.0, 0.0, 0.0))
    assert book.end(3.0) == FlightEntry(1, duration=1.0)
    book.add((9.0, 0.0, 0.0))
    assert book.flights == [book.flight(1)]
    with pytest.raises(RefusalError, match="no flight 2; 1 have ended"):
        book.flight(2)


@pytest.fixture
def process():
    """Return a process with a logbook, in which one flight of 3 s to x = 2 m has been flown."""
    fake = FakeProcess()
    assert fake.launch(LogbookNode(), "/logbook")
    fake.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.ON_GROUND))
    states = (FlightStatus.TAKING_OFF, FlightStatus.FLYING, FlightStatus.LANDING)
    for x, state in enumerate(states):
        fake.publish("/in_flight_flight_status", FlightStatus(state=state))
        position = PositionVelocityYawState(x=x)
        fake.publish("/state", PositionVelocityYawStateStamped(state=position))
        fake.advance(1.0)
    fake.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.ON_GROUND))
    return fake


def test_a_flight_is_published_once(process):
    [flight] = process.published("/logbook/flight")
    assert (flight.number, flight.distance) == (1, 2.0)
    assert flight.duration == pytest.approx(3.0)


def test_a_flight_is_told_by_service(process):
    response = process.call("/logbook/get_flight", GetFlightRequest(1))
    assert response.flight == process.published("/logbook/flight")[0]


def test_a_flight_that_has_not_been_flown_is_refused(process):
    with pytest.raises(ServiceError, match="no flight 7; 1 have ended"):
        process.call("/logbook/get_flight", GetFlightRequest(7))
