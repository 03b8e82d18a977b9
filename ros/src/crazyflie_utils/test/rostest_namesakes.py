"""A node is refused while another one of its name lives, which the master would shut down."""

import signal

import pytest
import rospy
from processes import composed, small_node
from std_msgs.msg import Float64

from crazyflie_utils.ros1.master_watch import living_node
from crazyflie_utils.testing.peer import LIMIT, listening, wait_until


@pytest.fixture
def first():
    """Return a node /group/first that runs."""
    with (
        listening("/group/first/time", Float64) as ticks,
        small_node("Ticker", "first", "__ns:=/group", "_time_step:=0.01") as process,
    ):
        ticks.get(timeout=LIMIT)
        yield process


def is_alive(process):
    """Return whether the node still publishes."""
    with listening("/group/first/time", Float64) as ticks:
        return ticks.get(timeout=LIMIT) is not None and process.is_running()


def test_the_second_one_ends_and_says_why(first):
    with small_node("Ticker", "first", "__ns:=/group", "_time_step:=0.01") as second:
        assert second.wait() == 1
    place = living_node("/group/first")
    assert f"/group/first runs already: {place}. It goes on" in second.output
    assert "Traceback" not in second.output
    assert is_alive(first)


def test_another_namespace_is_another_name(first):
    with (
        listening("/elsewhere/first/time", Float64) as ticks,
        small_node("Ticker", "first", "__ns:=/elsewhere", "_time_step:=0.01"),
    ):
        ticks.get(timeout=LIMIT)
    assert is_alive(first)


def test_one_that_has_died_is_replaced(first):
    first.signal(signal.SIGKILL)
    assert first.wait() == -signal.SIGKILL
    wait_until(lambda: living_node("/group/first") is None, "the end of the first one")
    with (
        listening("/group/first/time", Float64) as ticks,
        small_node("Ticker", "first", "__ns:=/group", "_time_step:=0.01"),
    ):
        ticks.get(timeout=LIMIT)


def test_a_node_among_others_of_a_process_is_one_as_well(first):
    rospy.set_param("/group/both/nodes", {"first": "small_nodes:Ticker"})
    with composed("both", "__ns:=/group") as second:
        assert second.wait() == 1
    assert "/group/both: /group/first runs already: process" in second.output
    assert is_alive(first)


def test_a_second_vehicle_of_the_same_controls_ends_after_a_pause():
    """Otherwise respawn would take the processor from the nodes that fly."""
    controls = "_topics/control:=/controls"
    with small_node("Flown", "one", controls):
        rospy.wait_for_service("/controls/vehicle", timeout=LIMIT)
        # As roslaunch starts it.
        with small_node("Flown", "two", controls, "__log:=/tmp/two.log") as second:
            wait_until(lambda: "not initialized" in second.output, "the refusal")
            assert second.is_running()
            second.signal(signal.SIGINT)
            assert second.wait() == 1
    assert "the controls of /controls already fly a vehicle of /one" in second.output
