"""The odometer, first the algorithm, then the node on a fake process."""

import math

import pytest
from std_srvs.srv import EmptyRequest

from crazyflie_msgs.msg import PositionVelocityYawState, PositionVelocityYawStateStamped
from crazyflie_utils.testing import FakeProcess
from odometer.odometer import Odometer
from odometer.odometer_node import OdometerNode

PARAMETERS = {"time_step": 0.1, "topics/state": "/state", "topics/distance": "/distance"}


def fly_to(process, x):
    """Tell the node where the vehicle is, m."""
    state = PositionVelocityYawState(x=x)
    process.publish("/state", PositionVelocityYawStateStamped(state=state))


def distance(process):
    """Return what the node publishes next, m."""
    process.advance(0.1)
    return process.published("/distance")[-1].data


@pytest.fixture
def process():
    """Return a process with an odometer in it."""
    fake = FakeProcess()
    assert fake.launch(OdometerNode(), "/odometer", PARAMETERS)
    return fake


def test_length_of_a_circle():
    odometer = Odometer(max_step=0.1)
    for angle in (2.0 * math.pi * k / 1000 for k in range(1001)):
        odometer.add((math.cos(angle), math.sin(angle), 1.0))
    assert odometer.distance == pytest.approx(2.0 * math.pi, rel=1e-5)


def test_publishes_the_distance_ten_times_a_second(process):
    for x in (0.0, 0.1, 0.25, 0.15):
        fly_to(process, x)
    assert distance(process) == pytest.approx(0.35)
    process.advance(1.0)
    assert len(process.published("/distance")) == 11


def test_a_jump_is_not_counted(process):
    for x in (0.0, 0.1, 5.0, 5.1):
        fly_to(process, x)
    assert distance(process) == pytest.approx(0.2)


def test_begins_again_after_a_reset(process):
    fly_to(process, 0.0)
    fly_to(process, 0.1)
    process.call("/odometer/reset", EmptyRequest())
    assert distance(process) == 0.0


def test_a_state_that_is_not_finite_is_ignored(process):
    for x in (0.0, math.nan, 0.1):
        fly_to(process, x)
    assert distance(process) == pytest.approx(0.1)
    assert "/state" in process.logged("warn")[0]


def test_a_bad_parameter_is_named():
    process = FakeProcess()
    assert not process.launch(OdometerNode(), "/odometer", {**PARAMETERS, "time_step": -0.1})
    expected = "parameter /odometer/time_step is -0.1; expected a finite number >= 0.0001 (s)"
    assert process.logged("error") == [f"/odometer: {expected}"]
