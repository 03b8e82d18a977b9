"""What waits in the socket of a publisher, without a master."""

import socket
from types import SimpleNamespace

import pytest
from rospy.exceptions import TransportTerminated
from std_msgs.msg import Int64

from crazyflie_utils.ros1.receiving import _Inbox
from crazyflie_utils.testing.hostile_publisher import frame


@pytest.fixture
def publisher():
    """Return the publisher's end of a connection, and that of the subscriber."""
    here, there = socket.socketpair()
    with here, there:
        protocol = SimpleNamespace(resolved_name="/t", recv_data_class=Int64, buff_size=65536)
        yield here, SimpleNamespace(socket=there, protocol=protocol, header={}, stat_bytes=0)


def inbox_of(connection):
    return _Inbox(connection, b"", lambda text, key: None)


def numbers(messages):
    return [message.data for message in messages]


def test_nothing_is_waited_for(publisher):
    here, connection = publisher
    inbox = inbox_of(connection)
    assert inbox.take_waiting(1) == []
    here.sendall(frame(Int64(1)) + frame(Int64(2))[:5])
    assert numbers(inbox.take_waiting(1)) == [1]
    here.sendall(frame(Int64(2))[5:])
    assert numbers(inbox.take_waiting(1)) == [2]


def test_a_connection_that_another_thread_closes_at_that_moment(publisher):
    here, connection = publisher
    inbox = inbox_of(connection)
    here.sendall(frame(Int64(1)))
    connection.protocol = None
    assert numbers(inbox.take_waiting(1)) == [1]


def test_a_flood_is_read_in_turns(publisher):
    here, connection = publisher
    connection.protocol.buff_size = 120
    inbox = inbox_of(connection)
    for number in range(25):
        here.sendall(frame(Int64(number)))
    assert numbers(inbox.take_waiting(1)) == list(range(10))
    assert numbers(inbox.take_waiting(16)) == list(range(10, 25))


def test_where_only_the_latest_counts_others_are_not_read(publisher, monkeypatch):
    here, connection = publisher
    monkeypatch.setattr(_Inbox, "reminders", [lambda: None])
    inbox = inbox_of(connection)
    assert inbox.take_waiting(1) == []
    here.sendall(b"".join(frame(Int64(number)) for number in range(5)) + frame(Int64(5))[:7])
    assert numbers(inbox.take_waiting(1)) == [4]
    here.sendall(frame(Int64(5))[7:])
    assert numbers(inbox.take_waiting(1)) == [5]


def test_who_collects_by_themselves_are_not_reminded(publisher, monkeypatch):
    here, connection = publisher
    inbox = inbox_of(connection)
    assert inbox.take_waiting(1) == []
    now = [10.0]
    collected = []

    def sleep(duration):
        now[0] += duration
        if len(collected) < 2:
            here.sendall(frame(Int64(len(collected))))
            collected.extend(numbers(inbox.take_waiting(1)))

    clock = SimpleNamespace(sleep=sleep, monotonic=lambda: now[0])
    monkeypatch.setattr("crazyflie_utils.ros1.receiving.time", clock)
    assert [inbox.wait(), inbox.wait()] == [False, False]
    assert collected == [0, 1]
    here.sendall(frame(Int64(2)))
    assert inbox.wait()
    assert numbers(inbox.take_waiting(1)) == [2]


def test_a_hang_up_is_left_to_the_thread_of_the_connection(publisher):
    here, connection = publisher
    inbox = inbox_of(connection)
    here.sendall(frame(Int64(1)))
    here.close()
    assert numbers(inbox.take_waiting(16)) == [1]
    assert inbox.take_waiting(1) == []
    with pytest.raises(TransportTerminated, match="hung up"):
        inbox.wait()
