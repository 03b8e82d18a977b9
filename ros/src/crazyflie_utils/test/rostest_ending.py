"""However a process is asked to end: it says a last word, and ends."""

import signal
import threading
import xmlrpc.client

import pytest
import rosgraph
import rosnode
import rospy
from processes import composed, small_node
from slow_master import slow_master
from small_nodes import SAFE
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

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


@pytest.mark.parametrize("ask", [interrupt, terminate])
def test_node_that_is_asked_while_it_registers_ends_after_that(ask):
    with (
        slow_master() as (uri, asked, may_go_on),
        small_node("Ticker", "early", "_time_step:=0.01", f"__master:={uri}") as process,
    ):
        assert asked.wait(LIMIT)
        ask(process, "early")
        may_go_on.set()
        assert process.wait() == 0
    assert "Traceback" not in process.output


def test_node_that_is_asked_while_it_waits_for_a_master_ends():
    with small_node("Ticker", "early", "__master:=http://127.0.0.1:1/") as process:
        wait_until(lambda: "waiting for a ROS master" in process.output, "it to wait")
        interrupt(process, "early")
        assert process.wait() == 1
    assert "ended before a ROS master was found" in process.output
    assert "Traceback" not in process.output


def test_node_may_end_its_process_with_a_status():
    with small_node("Quitter", "quitter", "_time_step:=0.01") as process:
        assert process.wait() == 3


def test_callback_that_never_returns_does_not_keep_the_process():
    with small_node("Stuck", "stuck", "_time_step:=0.01") as process:
        wait_until(lambda: "stuck from now on" in process.output, "the first tick")
        process.signal(signal.SIGINT)
        assert process.wait() == 1
    assert "a callback has not returned within 2 s" in process.output


def wait_for_notice(process):
    wait_until(lambda: "in flight; ends after the landing" in process.output, "the notice")


@pytest.fixture
def flight():
    """Return a pilot in flight at /cf/pilot, its instrument, and both processes, as heard."""
    with (
        listening("/cf/pilot/time", Float64) as ticks,
        listening("/cf/sensors/instrument/time", Float64) as measurements,
        small_node("Pilot", "pilot", "__ns:=/cf", "_time_step:=0.01") as pilot,
        small_node("Instrument", "instrument", "__ns:=/cf/sensors", "_time_step:=0.01") as other,
    ):
        ticks.get(timeout=LIMIT)
        measurements.get(timeout=LIMIT)
        wait_until(lambda: hears_of_flights("/cf/sensors/instrument"), "the flight")
        yield pilot, other


def hears_of_flights(node):
    """Return whether a node has received a message about flights: a connection is not enough."""
    slave = xmlrpc.client.ServerProxy(rosgraph.Master("/test").lookupNode(node))
    _, subscriptions, _ = slave.getBusStats("/test")[2]
    return any(
        topic == "/flights" and any(received > 0 for _, _, received, *_ in connections)
        for topic, connections in subscriptions
    )


@pytest.mark.parametrize("ask", [interrupt, terminate])
def test_processes_that_are_needed_in_flight_end_after_the_landing(flight, ask):
    for process in flight:
        ask(process, "")
    wait_for_notice(flight[0])
    wait_until(lambda: "asked to land" in flight[0].output, "the pilot's leaving")
    with listening("/cf/sensors/instrument/time", Float64) as measurements:
        assert measurements.get(timeout=LIMIT).data != SAFE
        assert rospy.ServiceProxy("/cf/pilot/land", Trigger)().success
        assert last_word(measurements) == SAFE
    assert [process.wait() for process in flight] == [0, 0]
    # Who ends the flight says so, once; the others need not.
    assert [process.output.count("in flight; ends after") for process in flight] == [1, 0]


@pytest.mark.parametrize("ask", [interrupt, terminate])
def test_second_signal_ends_at_once_and_safely(flight, ask):
    # The instrument is asked alone: no node ends the flight, and so it says that it waits.
    for process in reversed(flight):
        ask(process, "")
        wait_for_notice(process)
        ask(process, "")
        assert process.wait() == 0


def test_a_node_that_is_killed_by_ros_in_flight_waits_until_a_signal_comes(flight):
    for process, name in zip(
        reversed(flight), ("/cf/sensors/instrument", "/cf/pilot"), strict=True
    ):
        threading.Thread(target=kill_by_ros, args=(process, name), daemon=True).start()
        wait_for_notice(process)
        interrupt(process, name)
        assert process.wait() == 0


def test_flights_in_another_namespace_are_not_waited_for(flight):
    with (
        listening("/cf2/instrument/time", Float64) as measurements,
        small_node("Instrument", "instrument", "__ns:=/cf2", "_time_step:=0.01") as process,
    ):
        measurements.get(timeout=LIMIT)
        interrupt(process, "")
        assert process.wait() == 0
    assert "in flight; ends after" not in process.output
