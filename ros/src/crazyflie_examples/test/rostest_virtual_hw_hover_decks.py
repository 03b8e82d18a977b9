"""A whole flight of the hardware example by the vehicle's own estimate, and its end.

The deck loses what it measures with: the base stations are occluded, the floor's texture ends.
"""

import pytest
import rosnode
import rospy
from std_msgs.msg import String

from crazyflie_msgs.msg import FlightStatus
from crazyflie_reports.flight_operator import FlightError, ready_operator
from crazyflie_utils.testing import peer

HOVER = (0.0, 0.0, 1.0)
TOLERANCE = 0.05


@pytest.fixture(scope="module")
def operator():
    with ready_operator() as ready:
        yield ready


def test_flies_without_motion_capture(operator):
    assert "/mocap_node" not in rosnode.get_node_names()
    operator.takeoff()
    operator.hover(8.0)
    operator.land()
    mean, largest = operator.record.hover_error(HOVER, 3.0)
    assert 0.0 < mean <= largest < TOLERANCE
    assert operator.record.state.last[2] < 0.03


def test_lands_and_refuses_where_the_deck_sees_nothing(operator):
    if rospy.get_param("/virtual_crazyflie/positioning") == "lighthouse":
        fault, reason = ("occluded", 3), "Lighthouse"
    else:
        fault, reason = ("smooth", 5.0), "texture"
    with peer.listening("/in_flight_flight_status", FlightStatus) as states:
        operator.takeoff()
        rospy.set_param(f"/virtual_crazyflie/fault/{fault[0]}", fault[1])
        assert states.next(lambda message: reason in message.reason)
        assert states.next(lambda message: message.state == FlightStatus.ON_GROUND)
    with peer.listening("/crazyflie/positioning", String) as reasons:
        assert reasons.next(lambda message: bool(message.data))
    with pytest.raises(FlightError, match="/takeoff refused: .*" + reason):
        operator.takeoff()
