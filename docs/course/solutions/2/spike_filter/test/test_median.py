"""The node on a fake process, which needs no master."""

import math

import pytest
from std_msgs.msg import Float64
from std_srvs.srv import EmptyRequest

from crazyflie_utils.testing import FakeProcess
from spike_filter.median_node import MedianNode

PARAMETERS = {"topics/input": "/input", "topics/output": "/output", "window": 3}


@pytest.fixture
def process():
    """Return a process with the node in it."""
    fake = FakeProcess()
    assert fake.launch(MedianNode(), "/median", PARAMETERS)
    return fake


def median_of(process, *numbers):
    """Return what the node publishes after the last of these numbers."""
    for number in numbers:
        process.publish("/input", Float64(number))
    return process.published("/output")[-1].data


def test_publishes_medians(process):
    assert median_of(process, 2.0, 50.0, 3.0) == 3.0


def test_forgets_all_numbers_after_a_reset(process):
    median_of(process, 2.0, 2.0, 2.0)
    process.call("/median/reset", EmptyRequest())
    assert median_of(process, 7.0) == 7.0


def test_a_number_that_is_not_finite_is_ignored(process):
    assert median_of(process, 2.0, math.nan) == 2.0
    assert "/input" in process.logged("warn")[0]


def test_a_bad_parameter_is_named():
    process = FakeProcess()
    assert not process.launch(MedianNode(), "/median", {**PARAMETERS, "window": 0})
    [error] = process.logged("error")
    assert "/median/window is 0" in error
