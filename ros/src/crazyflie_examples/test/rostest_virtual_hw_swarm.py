"""Virtual vehicles take off, go and land together, over the radio's protocol.

Motion capture knows one of them as a rigid body and two by one marker each; or each flies by the
estimate of its deck.
"""

import math

import pytest
import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import Float32
from std_srvs.srv import Empty

from crazyflie_driver.srv import GoTo
from crazyflie_msgs.msg import PositionVelocityYawStateStamped
from crazyflie_utils.testing import peer

STARTS = {"cf1": (0.0, -0.5, 0.0), "cf2": (0.0, 0.5, 0.0), "cf3": (0.0, 1.0, 0.0)}
HOVER = 0.5
TOLERANCE = 0.1


@pytest.fixture(scope="module")
def places():
    """Return the vehicles' latest places, m, by name; all of them are connected."""
    found = {}

    def note(message, name):
        found[name] = (message.state.x, message.state.y, message.state.z)

    for name in STARTS:
        rospy.Subscriber(f"/{name}/state", PositionVelocityYawStateStamped, note, name)
    for name in STARTS:
        with peer.listening(f"/{name}/battery", Float32) as voltages:
            assert voltages.next(lambda message: message.data > 3.5)
    rospy.wait_for_service("/all/takeoff", 30.0)
    peer.wait_until(lambda: len(found) == len(STARTS), "states of all vehicles")
    return found


def wait_for(places, offset):
    for name, start in STARTS.items():
        goal = [a + b for a, b in zip(start, offset, strict=True)]
        peer.wait_until(
            lambda name=name, goal=goal: math.dist(places[name], goal) < TOLERANCE,
            f"{name} at {goal}: it is at {places[name]}",
        )


def test_all_take_off(places):
    rospy.ServiceProxy("/all/takeoff", Empty)()
    wait_for(places, (0.0, 0.0, HOVER))


def test_all_go(places):
    goal = Point(0.3, 0.0, 0.1)
    rospy.ServiceProxy("/all/go_to", GoTo)(0, True, goal, 0.0, rospy.Duration(2))
    wait_for(places, (0.3, 0.0, HOVER + 0.1))


def test_all_land(places):
    rospy.ServiceProxy("/all/land", Empty)()
    wait_for(places, (0.3, 0.0, 0.0))
    assert max(place[2] for place in places.values()) < 0.03
