"""The takeoff control filter in a process of its own, on a real master."""

import queue
import time

import pytest
import rospy
from std_msgs.msg import Empty, String

from crazyflie_msgs.msg import Control, ControlStamped

LIMIT = 15.0


@pytest.fixture(scope="module")
def final():
    """Return a queue of what is passed on."""
    received = queue.Queue()
    rospy.Subscriber("/control/final", ControlStamped, received.put)
    return received


@pytest.fixture(scope="module")
def say():
    """Return a function that publishes on a topic that the filter hears."""
    types = {
        "/control/takeoff": ControlStamped,
        "/control/lqr": ControlStamped,
        "/in_flight": Empty,
    }
    publishers = {
        topic: rospy.Publisher(topic, kind, queue_size=10) for topic, kind in types.items()
    }
    deadline = time.monotonic() + LIMIT
    while not all(publisher.get_num_connections() for publisher in publishers.values()):
        assert time.monotonic() < deadline, "the filter does not listen"
        time.sleep(0.01)
    return lambda topic, message: publishers[topic].publish(message)


def control(thrust):
    return ControlStamped(control=Control(thrust=thrust))


def wait_for_thrust(value, final):
    while final.get(timeout=LIMIT).control.thrust != value:
        pass


def say_until_heard(say, topic, value, final):
    """Publish a control again and again until it is passed on."""
    deadline = time.monotonic() + LIMIT
    while time.monotonic() < deadline:
        say(topic, control(value))
        try:
            if final.get(timeout=0.1).control.thrust == value:
                return
        except queue.Empty:
            pass
    raise AssertionError(f"{value} on {topic} was never passed on")


def test_passes_the_right_control(say, final):
    # Nobody has said anything yet: the controller has the vehicle.
    say_until_heard(say, "/control/lqr", 1.0, final)
    say_until_heard(say, "/control/takeoff", 2.0, final)
    # The takeoff control gets old.
    say_until_heard(say, "/control/lqr", 3.0, final)

    memory = queue.Queue()
    rospy.Subscriber("/in_flight_filter", String, memory.put)
    assert memory.get(timeout=LIMIT).data == "commanded"
    say("/in_flight", Empty())
    assert memory.get(timeout=LIMIT).data == "flying"
    # In flight every control is passed on, whatever the age of the other kind.
    for value in range(10, 20):
        say("/control/takeoff", control(value))
        wait_for_thrust(value, final)
        say("/control/lqr", control(value + 0.5))
        wait_for_thrust(value + 0.5, final)
