"""The data of a publisher, split into messages, without a master."""

import io
import socket
from types import SimpleNamespace

import pytest
from rospy.exceptions import TransportTerminated
from std_msgs.msg import Int64

from crazyflie_utils.ros1.receiving import Inbox, RateLimiter
from crazyflie_utils.testing.hostile_publisher import frame


@pytest.fixture
def publisher():
    """Return the publisher's end of a connection, and that of the subscriber."""
    here, there = socket.socketpair()
    with here, there:
        protocol = SimpleNamespace(resolved_name="/t", recv_data_class=Int64, buff_size=65536)
        yield (
            here,
            SimpleNamespace(
                socket=there, protocol=protocol, header={}, stat_bytes=0, read_buff=io.BytesIO()
            ),
        )


def inbox_of(connection):
    return Inbox(connection, lambda text, key: None)


def numbers(inbox):
    return [message.data for message in inbox.receive(limits_rate=False)]


def test_messages_in_pieces(publisher):
    here, connection = publisher
    inbox = inbox_of(connection)
    here.sendall(frame(Int64(1)) + frame(Int64(2))[:5])
    assert numbers(inbox) == [1]
    here.sendall(frame(Int64(2))[5:] + frame(Int64(3))[:2])
    assert numbers(inbox) == [2]
    here.sendall(frame(Int64(3))[2:])
    assert numbers(inbox) == [3]


def test_of_a_flood_the_last_message_is_decoded(publisher):
    here, connection = publisher
    inbox = inbox_of(connection)
    here.sendall(b"".join(frame(Int64(number)) for number in range(500)))
    assert [each.data for each in inbox.receive(limits_rate=True)] == [499]
    connection.protocol.recv_data_class = type("Lossless", (Int64,), {"lossless": True})
    here.sendall(b"".join(frame(Int64(number)) for number in range(500)))
    assert [each.data for each in inbox.receive(limits_rate=True)] == list(range(500))


def test_a_connection_recovers_from_a_flood(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    limiter = RateLimiter()
    assert limiter.is_flooded(1_000_000)
    now[0] = 0.2
    assert not limiter.is_flooded(1)


def test_a_connection_that_another_thread_closes_at_that_moment(publisher):
    here, connection = publisher
    inbox = inbox_of(connection)
    here.sendall(frame(Int64(1)))
    connection.protocol = None
    assert numbers(inbox) == [1]


def test_a_hang_up_ends_the_connection(publisher):
    here, connection = publisher
    inbox = inbox_of(connection)
    here.sendall(frame(Int64(1)))
    here.close()
    assert numbers(inbox) == [1]
    with pytest.raises(TransportTerminated, match="hung up"):
        inbox.receive(limits_rate=False)
