"""A median filter removes spikes, and has a parameter: the exercise of lesson 2."""

from std_msgs.msg import Float64

from crazyflie_utils.testing import FakeProcess
from spike_filter.median import Median
from spike_filter.median_node import MedianNode, MedianParameters

TOPICS = {"topics/input": "/input", "topics/output": "/output"}


def test_a_spike_leaves_no_trace():
    median = Median(window=3)
    assert [median.add(number) for number in (1.0, 1.0, 90.0, 1.2, 1.1)] == [1, 1, 1, 1.2, 1.2]


def test_a_window_of_one_changes_nothing():
    median = Median(window=1)
    assert [median.add(number) for number in (1.0, 90.0)] == [1.0, 90.0]


def test_the_node_uses_its_parameter_window():
    process = FakeProcess()
    assert process.launch(MedianNode(), "/median", {**TOPICS, "window": 3})
    for number in (1.0, 1.0, 90.0, 80.0):
        process.publish("/input", Float64(number))
    assert process.published("/output")[-1].data == 80.0


def test_the_window_is_5_if_nobody_sets_it():
    assert MedianParameters.from_mapping(TOPICS).window == 5


def test_a_window_of_0_is_refused_by_name():
    process = FakeProcess()
    assert not process.launch(MedianNode(), "/median", {**TOPICS, "window": 0})
    [error] = process.logged("error")
    assert "/median/window is 0" in error
