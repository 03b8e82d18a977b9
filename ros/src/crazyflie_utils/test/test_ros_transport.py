"""How long the caller of a service waits, and how connections come about."""

import contextlib
import itertools
import math
import socket
import subprocess
import sys
import threading
from concurrent.futures import Future
from types import SimpleNamespace

import pytest
from rospy.impl import tcpros_base
from rospy.impl.tcpros_base import TCPROSTransport
from rospy.impl.tcpros_pubsub import TCPROSSub
from std_msgs.msg import String
from std_srvs.srv import Empty, EmptyRequest, EmptyResponse

from crazyflie_utils import ServiceError
from crazyflie_utils.ros1 import calls, patches
from crazyflie_utils.ros1.calls import wait_for_answer
from crazyflie_utils.ros1.own_topics import OwnPublication, OwnSubscription, PeerChanges
from crazyflie_utils.ros1.transport import RosTransport
from crazyflie_utils.testing.programs import wait_until


def ignore(text, key):
    """Take no note of what a peer did wrong."""


def test_an_answer_is_returned():
    answer = Future()
    answer.set_result("yes")
    assert wait_for_answer(answer, "/go", lambda: 0.0) == "yes"


def test_a_refusal_is_passed_on():
    answer = Future()
    answer.set_exception(ServiceError("not now"))
    with pytest.raises(ServiceError, match="^not now$"):
        wait_for_answer(answer, "/go", lambda: 0.0)


def test_caller_is_not_left_waiting_at_shutdown(monkeypatch):
    monkeypatch.setattr("rospy.core.is_shutdown", lambda: True)
    with pytest.raises(ServiceError, match="/go: the node is shutting down"):
        wait_for_answer(Future(), "/go", itertools.count().__next__)


def test_callers_are_answered_while_hooks_of_the_shutdown_run(monkeypatch):
    monkeypatch.setattr("rospy.core.is_shutdown_requested", lambda: True)
    answer = Future()
    timer = threading.Timer(0.01, answer.set_result, ("landed",))
    timer.start()
    assert wait_for_answer(answer, "/land", itertools.count().__next__) == "landed"


def test_caller_is_not_left_waiting_by_a_clock_that_stands_still(monkeypatch):
    monkeypatch.setattr(calls, "_STALL_LIMIT", 0.05)
    text = "/go: /clock has stood still for .* s; it may still be done"
    with pytest.raises(ServiceError, match=text):
        wait_for_answer(Future(), "/go", lambda: 7.0)


def test_unanswered_calls_do_not_pile_up(monkeypatch):
    answered = threading.Event()
    running = []

    def exchange(connection, request):
        running.append(connection.name)
        answered.wait(20.0)
        return EmptyResponse()

    monkeypatch.setattr("rospy.wait_for_service", lambda name, timeout: None)
    monkeypatch.setattr("crazyflie_utils.ros1.calls._Connection.exchange", exchange)
    transport = RosTransport()

    def call(name):
        return transport.call_service(name, Empty, EmptyRequest(), 60.0, math.inf)

    *unanswered, refused = (call("/slow") for _ in range(9))
    with pytest.raises(ServiceError, match="/slow has not answered 8 earlier calls"):
        refused.result(timeout=0)
    wait_until(lambda: len(running) == 8, "the calls run")
    # A service that is alive is not affected.
    other = call("/other")
    answered.set()
    for future in [*unanswered, other]:
        assert future.result(timeout=20.0) == EmptyResponse()
    assert running == ["/slow"] * 8 + ["/other"]
    assert call("/slow").result(timeout=20.0) == EmptyResponse()


# Connections.


def test_the_first_of_two_connections_to_a_publisher_stays():
    topic = OwnSubscription("/a", String, lambda: False, ignore, False, frozenset({"connect_once"}))
    protocol = TCPROSSub("/a", String)
    connections = [TCPROSTransport(protocol, "/a") for _ in range(4)]
    for connection, uri in zip(
        connections, ("http://x", "http://x", "http://y", "http://x"), strict=True
    ):
        connection.set_endpoint_id(uri)
    assert [topic.add_connection(each) for each in connections[:3]] == [True, False, True]
    # That of a publisher that has ended is not in the way of a new one.
    connections[0].close()
    assert topic.add_connection(connections[3])


@pytest.mark.parametrize(
    "topic",
    [
        OwnSubscription("/a", String, lambda: True, ignore, False, frozenset()),
        OwnPublication("/a", String, 1, False),
    ],
)
def test_a_topic_without_connections_is_not_polled(topic):
    """All topics are checked by rospy twice a second: a system call each."""
    topic.connection_poll = SimpleNamespace(error_iter=lambda: polls.append(topic) or ())
    polls = []
    topic.check()
    assert polls == []
    topic.connections = [None]
    topic.check()
    assert polls == [topic]


def test_connections_that_come_and_go_are_counted():
    """With a journal, nodes are told of others' subscribers when that has changed."""
    topic = OwnSubscription("/a", String, lambda: True, ignore, False, frozenset())
    connection = TCPROSTransport(TCPROSSub("/a", String), "/a")
    before = PeerChanges.count
    topic.add_connection(connection)
    added = PeerChanges.count
    connection.close()
    assert before < added < PeerChanges.count


def test_connections_that_come_at_once_are_not_put_off(monkeypatch):
    with contextlib.ExitStack() as stack:
        # It is never asked for one: all have to find a place in its queue.
        server = stack.enter_context(socket.create_server(("127.0.0.1", 0), backlog=5))
        rospys = SimpleNamespace(server_sock=server, inbound_handler=None)
        node = SimpleNamespace(tcp_ros_server=rospys, _tcp_server_callback=None)
        monkeypatch.setattr(tcpros_base, "_tcpros_server", node)
        patches.harden_tcp_server(ignore)
        handler = rospys.inbound_handler
        patches.harden_tcp_server(ignore)
        assert node._tcp_server_callback is rospys.inbound_handler is handler
        for _ in range(32):
            # Beyond the queue, the second try comes after 1 s.
            stack.enter_context(socket.create_connection(server.getsockname(), timeout=0.9))


def test_a_process_may_have_more_topics_than_a_shell_lets_it_have_files():
    program = """
import resource
from crazyflie_utils.ros1.transport import allow_many_topics

_, most = resource.getrlimit(resource.RLIMIT_NOFILE)
resource.setrlimit(resource.RLIMIT_NOFILE, (100, most))
allow_many_topics()
files = [open("/dev/null") for _ in range(200)]
"""
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60.0)


def test_callbacks_subscribe_without_waiting_for_the_master(monkeypatch):
    answers, done = threading.Event(), []

    class Subscriber:
        impl = None

        def __init__(self, name, *_, **__):
            answers.wait(20.0)
            done.append(f"subscribed to {name}")

        def unregister(self):
            done.append("unsubscribed")

        def get_num_connections(self):
            return 1

    monkeypatch.setattr("rospy.Subscriber", Subscriber)
    transport = RosTransport()
    transport.is_in_callback = lambda: True
    subscriber = transport.subscribe("/a", String, print)
    assert not subscriber.has_publishers()
    subscriber.close()
    # Later work, from any thread, does not overtake it.
    transport.is_in_callback = lambda: False
    transport.subscribe("/b", String, print)
    assert done == []
    answers.set()
    wait_until(lambda: len(done) == 3, "the master's answers", 20.0)
    assert done == ["subscribed to /a", "unsubscribed", "subscribed to /b"]


@pytest.mark.parametrize("limits_rate", [True, False])
def test_messages_wait_in_real_time_only(monkeypatch, limits_rate):
    """Simulated time may pass so quickly that a socket is full before a node looks something up."""
    callbacks = []

    class Subscriber:
        impl = None

        def __init__(self, _name, _kind, callback, **_):
            callbacks.append(callback)

    monkeypatch.setattr("rospy.Subscriber", Subscriber)
    transport = RosTransport(limits_rate)
    transport.subscribe("/a", String, print, lambda: True)
    transport.subscribe("/b", String, print)
    assert [callback.may_wait() for callback in callbacks] == [limits_rate, False]
