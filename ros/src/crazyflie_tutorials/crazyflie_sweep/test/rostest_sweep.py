"""A whole mission on simulated time: without a velocity it hovers, then it covers the area."""

import math

import pytest
import rospy

from crazyflie_reports.flight_operator import ready_operator
from crazyflie_tutorial_msgs.msg import SweepReport
from crazyflie_tutorial_msgs.srv import VelocityAt
from crazyflie_utils.testing import peer


def is_in(state):
    return lambda report: report.state == state or report.state == SweepReport.FAILED


@pytest.fixture(scope="module")
def mission():
    """Fly once: the reports of a hover, then the one at the end, and where the vehicle was."""
    with (
        ready_operator() as operator,
        peer.listening("/sweep/report", SweepReport) as reports,
    ):
        hovering = reports.next(is_in(SweepReport.HOVERING))
        before = operator.position.copy()
        operator.hover(5.0)
        after = operator.position.copy()
        # A relay to the service of velocity_server: what was missing.
        oscillator = rospy.ServiceProxy("/oscillator", VelocityAt, persistent=True)
        rospy.Service("/outside/oscillator", VelocityAt, lambda request: oscillator(request.x))
        while not (report := reports.next()).is_final:
            pass
        operator.hover(1.0)
        yield hovering, (before, after), report, operator.position


def test_hovers_without_a_velocity(mission):
    hovering, (before, after), *_ = mission
    assert (hovering.state, hovering.is_final) == (SweepReport.HOVERING, False)
    assert hovering.reason.startswith("/outside/oscillator")
    # It had hardly begun its way to the first lane.
    assert math.dist(before, (0.0, 0.0, 1.0)) < 0.4
    assert math.dist(before, after) < 0.2
    assert after[2] == pytest.approx(1.0, abs=0.05)


def test_then_covers_the_area(mission):
    report = mission[2]
    assert (report.state, report.reason) == (SweepReport.DONE, "")
    assert report.coverage >= 0.99
    assert report.max_lane_distance < 0.12
    assert report.hovering > 4.0
    assert 20.0 < report.duration - report.hovering < 80.0


def test_and_lands_at_the_end_of_the_last_lane(mission):
    assert mission[3] == pytest.approx((1.0, 0.5, 0.0), abs=0.1)
