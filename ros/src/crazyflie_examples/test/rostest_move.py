"""A flight from point to point through the service /move."""

import math

import pytest
import rospy
from std_srvs.srv import Empty

from crazyflie_reports.flight_operator import ready_operator
from crazyflie_reports.flight_record import GROUND_TOLERANCE

POINTS = [(0.4, 0.0, 1.0), (0.4, 0.3, 1.3), (-0.2, 0.0, 0.6)]
TOLERANCE = 0.02
FLIGHT_LIMIT = 20.0
SERVICE_LIMIT = 10.0


@pytest.fixture(scope="module")
def operator():
    with ready_operator() as operator:
        operator.takeoff()
        yield operator


def distance_after_move(operator, point):
    """Return how near (m) the vehicle came to a point after /move was called."""
    rospy.wait_for_service("/move", SERVICE_LIMIT)
    rospy.ServiceProxy("/move", Empty)()
    for _ in range(int(FLIGHT_LIMIT / 0.1)):
        operator.hover(0.1)
        if math.dist(operator.position, point) < TOLERANCE:
            break
    return math.dist(operator.position, point)


@pytest.mark.parametrize("point", [*POINTS, POINTS[0]])
def test_flies_to_the_next_point(operator, point):
    assert math.dist(operator.position, point) > TOLERANCE
    assert distance_after_move(operator, point) < TOLERANCE


def test_stays_there(operator):
    operator.hover(3.0)
    assert math.dist(operator.position, POINTS[0]) < TOLERANCE


def test_lands_from_there(operator):
    operator.land()
    x, y, _ = POINTS[0]
    assert math.dist(operator.position, (x, y, 0.0)) < TOLERANCE + GROUND_TOLERANCE
