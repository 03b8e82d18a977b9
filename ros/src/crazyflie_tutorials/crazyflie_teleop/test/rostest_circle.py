"""A vehicle takes off by itself, flies a circle from cmd_vel alone, and lands."""

import math

import numpy as np
import pytest

from crazyflie_msgs.msg import FlightStatus
from crazyflie_reports.flight_operator import ready_operator
from crazyflie_utils.testing import peer

RADIUS, SPEED = 0.5, 0.3
PERIOD = 2.0 * math.pi * RADIUS / SPEED


@pytest.fixture(scope="module")
def flight():
    """Fly more than one circle; return the states on the last one, and where it landed."""
    topic = "/in_flight_flight_status"
    with ready_operator() as operator, peer.listening(topic, FlightStatus) as flight:
        flight.next(lambda status: status.state == FlightStatus.FLYING)
        operator.hover(PERIOD / 2.0)
        operator.hover(PERIOD)
        operator.land()
        record = operator.finish()
        end = record.events["land"]
        return record.state.between(end - PERIOD, end), operator.position


@pytest.fixture
def circle(flight):
    """Return the middle of what was flown, m, and the angles as seen from there, rad."""
    x, y = flight[0][:, 0], flight[0][:, 1]
    middle = np.array([(x.max() + x.min()) / 2.0, (y.max() + y.min()) / 2.0])
    return middle, np.unwrap(np.arctan2(y - middle[1], x - middle[0]))


def test_is_a_circle_to_the_right_of_where_it_began(flight, circle):
    middle, _ = circle
    # A clockwise circle from (0, 0), looking along x, apart from the error of the start.
    assert middle == pytest.approx([0.0, -RADIUS], abs=0.2)
    distances = np.linalg.norm(flight[0][:, :2] - middle, axis=1)
    assert distances == pytest.approx(np.full_like(distances, RADIUS), abs=0.1)
    assert flight[0][:, 2] == pytest.approx(np.full_like(distances, 1.0), abs=0.05)


def test_is_flown_clockwise_once_in_its_period(circle):
    _, angles = circle
    assert angles[-1] - angles[0] == pytest.approx(-2.0 * math.pi, abs=0.3)
    assert np.all(np.diff(angles) < 0.02)


def test_the_nose_looks_along_it(flight):
    headings = np.arctan2(flight[0][:, 4], flight[0][:, 3])
    differences = np.angle(np.exp(1j * (flight[0][:, 6] - headings)))
    assert np.abs(differences).max() < 0.5


def test_lands_though_cmd_vel_goes_on(flight):
    assert flight[1][2] == pytest.approx(0.0, abs=0.05)
