"""Several virtual vehicles, started by roslaunch, in processes of their own."""

import socket
import time

import pytest
import rospy

from crazyflie_utils.testing.peer import LIMIT, wait_until
from crazyflie_virtual.server import Observation

FIRST_PORT, OBSERVER_PORT = 17850, 17800


def answers(port, timeout=0.2):
    """Tell whether a vehicle echoes a ping."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as pinger:
        pinger.settimeout(timeout)
        pinger.connect(("127.0.0.1", port))
        try:
            pinger.send(b"\xfcping")
            return pinger.recv(64) == b"\xfcping"
        except (TimeoutError, ConnectionError):
            return False


@pytest.mark.parametrize("number", [0, 1, 2])
def test_each_has_its_port(number):
    wait_until(lambda: answers(FIRST_PORT + number), "an answer")


def test_they_stand_side_by_side():
    positions = {}
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as observer:
        observer.bind(("127.0.0.1", OBSERVER_PORT))
        observer.settimeout(LIMIT)
        end = time.monotonic() + LIMIT
        while len(positions) < 3 and time.monotonic() < end:
            observation = Observation.decode(observer.recv(1024))
            positions[observation.body_id] = observation.position
    assert sorted(positions.values()) == [(0.0, 0.0, 0.0), (0.0, 0.5, 0.0), (0.0, 1.0, 0.0)]


def test_a_switch_is_a_parameter():
    wait_until(lambda: answers(FIRST_PORT + 1), "an answer")
    rospy.set_param("/virtual_crazyflie_2/fault/silence", 1000)
    wait_until(lambda: not answers(FIRST_PORT + 1), "silence")
    assert answers(FIRST_PORT, timeout=LIMIT)
    rospy.set_param("/virtual_crazyflie_2/fault/silence", 0)
    wait_until(lambda: answers(FIRST_PORT + 1), "an answer")
