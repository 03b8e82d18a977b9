"""Server and filter are killed in flight and on the ground, and started again."""

import contextlib
import os
import signal
from xmlrpc.client import ServerProxy

import pytest
import rosgraph
import rospy
from std_srvs.srv import Empty as EmptyService
from takeoff_helpers import text_of

from crazyflie_msgs.msg import Control, ControlStamped, FilterStatus, FlightStatus
from crazyflie_utils.testing.peer import LIMIT, listening, wait_until

COMMANDED = 9.0
SERVER, FILTER = "/takeoff_server", "/takeoff_control_filter"


@pytest.fixture(scope="module")
def heard():
    """Return a queue for each topic, while a controller is publishing."""
    topics = {
        "/in_flight_flight_status": FlightStatus,
        "/in_flight_filter_status": FilterStatus,
        "/control/takeoff": ControlStamped,
        "/control/final": ControlStamped,
    }
    with contextlib.ExitStack() as stack:
        queues = {
            topic: stack.enter_context(listening(topic, kind)) for topic, kind in topics.items()
        }
        publisher = rospy.Publisher("/control/lqr", ControlStamped, queue_size=10)
        control = ControlStamped(control=Control(thrust=COMMANDED))
        timer = rospy.Timer(rospy.Duration(0.02), lambda _: publisher.publish(control))
        stack.callback(timer.shutdown)
        yield queues


def kill(node, heard):
    """Kill a node at any moment; roslaunch restarts it.

    Earlier messages are dropped.
    """
    uri = rosgraph.Master("/rostest_restart").lookupNode(node)
    _, _, pid = ServerProxy(uri).getPid("/rostest_restart")
    os.kill(pid, signal.SIGKILL)
    for messages in heard.values():
        messages.drain()


def service(name):
    rospy.wait_for_service(name, timeout=LIMIT)
    return rospy.ServiceProxy(name, EmptyService)


def call_when_there(name):
    """Call a service of a node that may just be starting again."""

    def is_answered():
        try:
            service(name)()
        except rospy.ServiceException as error:
            if "refused:" in str(error):
                raise
            return False
        return True

    wait_until(is_answered, f"{name} to come back")


def wait_for(heard, topic, word):
    heard[topic].next(lambda message: text_of(message) == word)


def wait_for_both(heard, word):
    """Wait until the server has said a word and the filter remembers it."""
    wait_for(heard, "/in_flight_flight_status", word)
    wait_for(heard, "/in_flight_filter_status", word)


def thrusts(heard, topic, count):
    """Return the next ``count`` thrusts on a topic, and those that have come before."""
    messages = heard[topic]
    return [messages.next().control.thrust for _ in range(messages.qsize() + count)]


def test_on_the_ground_first(heard):
    wait_for_both(heard, "on_ground")
    kill(SERVER, heard)
    wait_for(heard, "/in_flight_flight_status", "on_ground")
    assert set(thrusts(heard, "/control/final", 50)) == {0.0}
    kill(FILTER, heard)
    wait_for(heard, "/in_flight_filter_status", "on_ground")
    assert set(thrusts(heard, "/control/final", 50)) == {0.0}
    with pytest.raises(rospy.ServiceException, match="on the ground"):
        call_when_there("/land")


def test_then_in_flight(heard):
    call_when_there("/takeoff")
    wait_for_both(heard, "flying")
    kill(SERVER, heard)
    wait_for(heard, "/in_flight_flight_status", "flying")
    assert set(thrusts(heard, "/control/final", 50)) == {COMMANDED}
    assert heard["/control/takeoff"].empty()
    kill(FILTER, heard)
    wait_for(heard, "/in_flight_filter_status", "flying")
    assert set(thrusts(heard, "/control/final", 50)) == {COMMANDED}
    assert heard["/control/takeoff"].empty()
    with pytest.raises(rospy.ServiceException, match="in flight"):
        call_when_there("/takeoff")


def test_and_on_the_ground_again(heard):
    call_when_there("/land")
    wait_for_both(heard, "on_ground")
    thrusts(heard, "/control/final", 20)
    kill(FILTER, heard)
    wait_for(heard, "/in_flight_filter_status", "on_ground")
    assert set(thrusts(heard, "/control/final", 50)) == {0.0}
    kill(SERVER, heard)
    wait_for(heard, "/in_flight_flight_status", "on_ground")
    assert set(thrusts(heard, "/control/final", 50)) == {0.0}
