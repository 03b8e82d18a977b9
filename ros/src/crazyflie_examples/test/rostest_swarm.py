"""Five simulated vehicles take off, go, keep apart, and land, called from outside."""

import math

import pytest
import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import String
from std_srvs.srv import Empty
from tf2_msgs.msg import TFMessage

from crazyflie_driver.srv import GoTo
from crazyflie_msgs.msg import PositionVelocityYawStateStamped
from crazyflie_utils.testing import peer

NAMES = ["cf1", "cf2", "cf3", "cf4", "cf5"]
CLOSEST = 0.3
"""Two collision buffers, m."""


@pytest.fixture(scope="module")
def places():
    """Return the vehicles' latest places, m, by name."""
    found = {}

    def note(message, name):
        found[name] = (message.state.x, message.state.y, message.state.z)

    for name in NAMES:
        rospy.Subscriber(f"/{name}/state", PositionVelocityYawStateStamped, note, name)
    rospy.wait_for_service("/all/takeoff", 30.0)
    peer.wait_until(lambda: len(found) == len(NAMES), "states of all vehicles")
    return found


def call(name, service_type=Empty, *arguments):
    rospy.ServiceProxy(name, service_type)(*arguments)


def go_to(name, goal, relative=False):
    call(f"/{name}/go_to", GoTo, 0, relative, Point(*goal), 0.0, rospy.Duration(3))


def test_all_take_off(places):
    call("/all/takeoff")
    assert {name: round(place[2], 1) for name, place in places.items()} == dict.fromkeys(NAMES, 1.0)


def test_one_message_tells_tf_of_all():
    with peer.listening("/tf", TFMessage) as messages:
        assert [each.child_frame_id for each in messages.next().transforms] == NAMES


def test_all_go(places):
    before = dict(places)
    go_to("all", (0.0, 0.5, 0.5), relative=True)
    for name in NAMES:
        x, y, z = before[name]
        peer.wait_until(
            lambda name=name, goal=(x, y + 0.5, z + 0.5): math.dist(places[name], goal) < 0.05,
            f"the arrival of {name}",
        )


def test_two_that_are_sent_to_each_other_keep_apart(places):
    first, second = places["cf1"], places["cf2"]
    distances = []

    def note(message):
        # Positions at one moment: states come one by one, and simulated time passes quickly.
        at = {each.child_frame_id: each.transform.translation for each in message.transforms}
        a, b = at["cf1"], at["cf2"]
        distances.append(math.dist((a.x, a.y, a.z), (b.x, b.y, b.z)))

    with peer.listening("/fleet/waiting", String) as waiting:
        watcher = rospy.Subscriber("/tf", TFMessage, note)
        go_to("cf1", second)
        go_to("cf2", first)
        assert waiting.next(lambda message: message.data == "cf1 cf2")
        go_to("cf1", first)
        peer.wait_until(lambda: math.dist(places["cf1"], first) < 0.05, "the return of cf1")
        watcher.unregister()
    assert min(distances) > CLOSEST


def test_all_land(places):
    call("/land_all")
    assert max(place[2] for place in places.values()) < 0.05
