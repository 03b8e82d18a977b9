"""Asks a controller for a control, for the tests on a real master."""

import queue

import pytest
import rospy

from crazyflie_msgs.msg import ControlStamped


def ask(reference, state):
    """Publish a reference on /ref and a state on /state until a control answers; return it."""
    controls = queue.Queue()
    subscriber = rospy.Subscriber("/control/lqr", ControlStamped, controls.put)
    references = rospy.Publisher("/ref", type(reference), latch=True, queue_size=1)
    references.publish(reference)
    states = rospy.Publisher("/state", type(state), queue_size=1)
    try:
        for _ in range(1000):
            states.publish(state)
            try:
                return controls.get(timeout=0.01)
            except queue.Empty:
                continue
    finally:
        for endpoint in (subscriber, references, states):
            endpoint.unregister()
    return pytest.fail("no control within 10 s")
