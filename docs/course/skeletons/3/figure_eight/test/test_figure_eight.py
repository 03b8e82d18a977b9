"""The figure of eight, first the algorithm, then the node on a fake process."""

import math

import numpy as np
import pytest

from crazyflie_msgs.msg import FlightStatus
from crazyflie_utils.testing import FakeProcess
from figure_eight.figure_eight import FigureEight
from figure_eight.figure_eight_node import FigureEightNode

PERIOD = 2.0 * math.pi * 0.5 / 0.3
"""Of one circle of the default radius and speed, s."""


def test_what_is_flown_is_an_eight():
    eight = FigureEight(radius=0.5, speed=0.3)
    dt = 0.001
    times = np.arange(0.0, 2.0 * PERIOD, dt)
    yaw = np.cumsum([eight.yaw_rate(time) * dt for time in times])
    x, y = np.cumsum(0.3 * np.cos(yaw) * dt), np.cumsum(0.3 * np.sin(yaw) * dt)
    assert (x[-1], y[-1], yaw[-1]) == pytest.approx((0.0, 0.0, 0.0), abs=0.01)
    assert (y.min(), y.max()) == pytest.approx((-1.0, 1.0), abs=0.01)
    assert y[times < PERIOD].max() < 0.01


@pytest.fixture
def process():
    """Return a process with the node in it."""
    fake = FakeProcess()
    assert fake.launch(FigureEightNode(), "/figure_eight")
    return fake


def test_waits_for_the_flight(process):
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.TAKING_OFF))
    process.advance(1.0)
    assert process.published("/cmd_vel") == []


def test_turns_to_the_right_then_to_the_left(process):
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))
    process.advance(1.0)
    assert process.published("/cmd_vel")[-1].angular.z == pytest.approx(-0.6)
    assert process.published("/figure_eight/circles")[-1].data == 0
    process.advance(PERIOD)
    assert process.published("/cmd_vel")[-1].angular.z == pytest.approx(0.6)
    assert process.published("/figure_eight/circles")[-1].data == 1


def test_is_silent_after_the_flight(process):
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))
    process.advance(1.0)
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.DESCENDING))
    count = len(process.published("/cmd_vel"))
    process.advance(1.0)
    assert len(process.published("/cmd_vel")) == count
