"""The data of a publisher, split into messages, without a master."""

import io
import socket
import struct
import threading
import time
from types import SimpleNamespace

import pytest
from rospy.exceptions import TransportTerminated
from std_msgs.msg import Int64

from crazyflie_utils.ros1.receiving import (
    MAX_MESSAGE_SIZE,
    Inbox,
    RateLimiter,
    Reception,
    collect_waiting,
)
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
                socket=there,
                protocol=protocol,
                header={},
                read_buff=io.BytesIO(),
                stat_bytes=0,
                stat_num_msg=0,
                is_latched=False,
                done=False,
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


class Subscriber:
    """Receives numbers from a connection as rospy does, in a thread."""

    def __init__(self, connection):
        self.received: list[int] = []
        self.reports: list[str] = []
        self.may_wait = True
        self.error: Exception | None = None
        self.reception = Reception(
            connection,
            lambda text, key: self.reports.append(text),
            False,
            lambda: self.may_wait,
            self._deliver,
        )
        self.thread = threading.Thread(target=self._receive, daemon=True)

    def _deliver(self, messages, _):
        self.received += [message.data for message in messages]

    def _receive(self):
        try:
            while True:
                self._deliver(self.reception.receive_once(), None)
        except TransportTerminated as error:
            self.error = error

    def receives(self, *expected):
        """Return whether these are the numbers that come within 5 s."""
        return becomes_true(lambda: self.received == list(expected))


def becomes_true(condition):
    end = time.monotonic() + 5.0
    while not condition() and time.monotonic() < end:
        time.sleep(0.001)
    return condition()


@pytest.fixture
def subscriber(publisher, monkeypatch):
    """Return a subscriber that has received the number 1, and whose messages wait now."""
    here, connection = publisher
    monkeypatch.setattr("rospy.core.is_shutdown", lambda: False)
    subscriber = Subscriber(connection)
    here.sendall(frame(Int64(1)))
    subscriber.thread.start()
    assert subscriber.receives(1)
    yield subscriber
    here.close()
    subscriber.thread.join(5.0)
    assert not subscriber.thread.is_alive()


def test_messages_wait_until_they_are_collected(publisher, subscriber, monkeypatch):
    here, connection = publisher
    monkeypatch.setattr("crazyflie_utils.ros1.receiving.PATIENCE", 1.0)
    here.sendall(frame(Int64(2)))
    assert subscriber.receives(1, 2)  # The thread may have waited for a shorter time already.
    here.sendall(frame(Int64(3)) + frame(Int64(4))[:5])
    assert connection.stat_num_msg == 2
    collect_waiting()
    assert subscriber.received == [1, 2, 3]
    here.sendall(frame(Int64(4))[5:])
    collect_waiting()
    assert subscriber.received == [1, 2, 3, 4]
    assert connection.stat_num_msg == 4


def test_messages_that_nobody_collects_come_by_themselves(publisher, subscriber):
    here, _ = publisher
    here.sendall(frame(Int64(2)) + frame(Int64(3)))
    assert subscriber.receives(1, 2, 3)


def test_messages_that_may_not_wait_are_received_by_the_thread_alone(publisher, subscriber):
    here, _ = publisher
    subscriber.may_wait = False
    here.sendall(frame(Int64(2)))
    assert subscriber.receives(1, 2)
    # Two threads that read one socket would mix up the order, also after that.
    subscriber.may_wait = True
    here.sendall(frame(Int64(3)))
    collect_waiting()
    assert subscriber.receives(1, 2, 3)


def test_a_flood_does_not_wait(publisher, subscriber, monkeypatch):
    here, connection = publisher
    monkeypatch.setattr("crazyflie_utils.ros1.receiving._MAX_READS", 2)
    connection.protocol.buff_size = 2 * len(frame(Int64(2)))
    here.sendall(b"".join(frame(Int64(number)) for number in range(2, 10)))
    assert subscriber.receives(*range(1, 10))
    subscriber.may_wait = True
    here.sendall(frame(Int64(10)))
    collect_waiting()
    assert subscriber.receives(*range(1, 11))


def test_a_hang_up_that_a_collector_sees_ends_the_connection(publisher, subscriber):
    here, _ = publisher
    here.sendall(frame(Int64(2)))
    here.close()
    collect_waiting()
    collect_waiting()
    assert subscriber.receives(1, 2)
    assert becomes_true(lambda: subscriber.error is not None)
    assert "hung up" in str(subscriber.error)


def test_a_message_without_end_that_a_collector_sees_ends_the_connection(publisher, subscriber):
    here, _ = publisher
    size = MAX_MESSAGE_SIZE + 1
    here.sendall(struct.pack("<I", size) + frame(Int64(2)))
    collect_waiting()
    assert becomes_true(lambda: subscriber.error is not None)
    assert subscriber.received == [1]
    assert subscriber.reports == [f"disconnecting a publisher of /t: {size} bytes a message"]
