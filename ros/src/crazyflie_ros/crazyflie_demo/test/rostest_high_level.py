"""Flights by high-level commands, and log blocks of one's own, with a virtual vehicle."""

import signal

import numpy as np
import pytest
import rospy
from flights import LIMIT, node, observed_vehicle

from crazyflie_driver.msg import GenericLogData


@pytest.fixture(scope="module")
def observer():
    """Return an observer of a vehicle that the driver knows as /crazyflie."""
    with observed_vehicle() as observer:
        yield observer


def demo(name, **parameters):
    return node("crazyflie_demo", name, "__ns:=crazyflie", **parameters)


def is_down(truth):
    return truth.position[2] < 0.02


def is_above(height):
    return lambda truth: truth.position[2] > height


def test_log_blocks(observer):
    for name, count in (("log1", 3), ("log2", 4)):
        message = rospy.wait_for_message(f"/crazyflie/{name}", GenericLogData, LIMIT)
        assert len(message.values) == count
    # The last variable is the battery's voltage.
    assert 3.0 < message.values[-1] < 4.3


def test_a_test_flight(observer):
    with demo("test_high_level.py", duration=1.5, distance=0.4, height=0.4) as flight:
        observer.track_until(is_above(0.35))
        track = observer.track_until(is_down)
        assert flight.wait(LIMIT) == 0
    across = np.array([truth.position[:2] for truth in track])
    assert across[:, 0].max() == pytest.approx(0.4, abs=0.1)
    np.testing.assert_allclose(across[-1], 0.0, atol=0.1)
    np.testing.assert_allclose(across[:, 1], 0.0, atol=0.1)


def test_a_flight_that_is_interrupted_ends_with_a_landing(observer):
    with demo("test_high_level.py", duration=1.5) as flight:
        observer.track_until(is_above(0.3))
        flight.send_signal(signal.SIGINT)
        track = observer.track_until(is_down)
        assert flight.wait(LIMIT) == 0
    # A fall from there would take a third of a second.
    highest = max(track, key=lambda truth: truth.position[2])
    assert track[-1].time - highest.time > 0.8


def test_a_constant_thrust_lifts_and_ends(observer):
    with demo("const_thrust.py", thrust=48000) as thrust:
        observer.track_until(is_above(0.1))
        thrust.send_signal(signal.SIGINT)
        observer.track_until(is_down)
        assert thrust.wait(LIMIT) == 0
