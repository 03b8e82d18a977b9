"""A flight from point to point through the service /move."""

import math

import pytest
import rospy
from std_srvs.srv import Empty

from crazyflie_dev.flight_record import GROUND_TOLERANCE
from crazyflie_dev.pilot import boarded

POINTS = [(0.4, 0.0, 1.0), (0.4, 0.3, 1.3), (-0.2, 0.0, 0.6)]
TOLERANCE = 0.02
FLIGHT_LIMIT = 20.0
SERVICE_LIMIT = 10.0


@pytest.fixture(scope="module")
def pilot():
    with boarded() as pilot:
        pilot.takeoff()
        yield pilot


def distance_after_move(pilot, point):
    """Return how near (m) the vehicle came to a point after /move was called."""
    rospy.wait_for_service("/move", SERVICE_LIMIT)
    rospy.ServiceProxy("/move", Empty)()
    for _ in range(int(FLIGHT_LIMIT / 0.1)):
        pilot.hover(0.1)
        if math.dist(pilot.position, point) < TOLERANCE:
            break
    return math.dist(pilot.position, point)


@pytest.mark.parametrize("point", [*POINTS, POINTS[0]])
def test_flies_to_the_next_point(pilot, point):
    assert math.dist(pilot.position, point) > TOLERANCE
    assert distance_after_move(pilot, point) < TOLERANCE


def test_stays_there(pilot):
    pilot.hover(3.0)
    assert math.dist(pilot.position, POINTS[0]) < TOLERANCE


def test_lands_from_there(pilot):
    pilot.land()
    x, y, _ = POINTS[0]
    assert math.dist(pilot.position, (x, y, 0.0)) < TOLERANCE + GROUND_TOLERANCE
