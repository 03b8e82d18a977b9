"""However a process is asked to end: it says a last word, and ends."""

import signal

import pytest
import rosnode
import rospy
from processes import composed, small_node
from small_nodes import SAFE
from std_msgs.msg import Float64

from crazyflie_utils.testing.peer import LIMIT, listening, wait_until


def interrupt(process, name):
    process.signal(signal.SIGINT)


def terminate(process, name):
    process.signal(signal.SIGTERM)


def kill_by_ros(process, name):
    rosnode.kill_nodes([name])


def last_word(heard):
    """Return what was heard last, after the publisher has ended."""
    while (number := heard.get(timeout=LIMIT).data) != SAFE:
        pass
    assert heard.empty()
    return number


@pytest.mark.parametrize("ask", [interrupt, terminate, kill_by_ros])
def test_node_says_a_last_word(ask):
    name = f"/{ask.__name__}"
    with (
        listening(f"{name}/time", Float64) as heard,
        small_node("Ticker", name[1:], "_time_step:=0.01") as process,
    ):
        heard.get(timeout=LIMIT)
        ask(process, name)
        assert process.wait() == 0
        assert last_word(heard) == SAFE
    assert "Traceback" not in process.output


def test_every_node_of_a_process_says_a_last_word():
    rospy.set_param("/one", {"time_step": 0.01})
    rospy.set_param("/two", {"time_step": 0.01})
    with (
        listening("/one/time", Float64) as one,
        listening("/two/time", Float64) as two,
        composed("both", one="Ticker", two="Ticker") as process,
    ):
        one.get(timeout=LIMIT)
        two.get(timeout=LIMIT)
        process.signal(signal.SIGINT)
        assert process.wait() == 0
        assert last_word(one) == last_word(two) == SAFE


def test_node_may_end_its_process_with_a_status():
    with small_node("Quitter", "quitter", "_time_step:=0.01") as process:
        assert process.wait() == 3


def test_callback_that_never_returns_does_not_keep_the_process():
    with small_node("Stuck", "stuck", "_time_step:=0.01") as process:
        wait_until(lambda: "stuck from now on" in process.output, "the first tick")
        process.signal(signal.SIGINT)
        assert process.wait() == 1
    assert "a callback has not returned within 2 s" in process.output
