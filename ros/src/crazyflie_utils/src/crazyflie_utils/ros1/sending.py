"""How messages leave a process: at once, and without ever waiting for who receives them.

rospy has the choice between sending in the publisher's thread, which a frozen subscriber stops, and
a thread for every subscriber, which costs more than the message. Here a message is sent in the
publisher's thread as far as the socket takes it; only who does not keep up gets a thread.
"""

import functools
import io
import itertools
import select
import socket
import struct
import threading
from collections import deque
from typing import Any

import genpy
import rospy
from rospy.exceptions import TransportTerminated

_LENGTH = struct.Struct("<I")

_AT_ONCE = socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL


@functools.cache
def never_wait_for_subscribers() -> None:
    """Have rospy's publishers with a queue send as above."""
    rospy.topics.QueuedConnection = _PatientConnection


def publish(publisher: rospy.Publisher, *messages: genpy.Message) -> None:
    """Publish messages that are of the publisher's type, all at once.

    It does what ``publisher.publish(message)`` does, without looking at them first.
    """
    implementation = publisher.impl
    if implementation is None or implementation.closed:
        publisher.publish(messages[-1])
        return
    with implementation.publock:
        if implementation.is_latch:
            implementation.latch = messages[-1]
        if not implementation.connections:
            return
        first = implementation.seq + 1
        implementation.seq += len(messages)
        data = b"".join(map(_on_the_wire, messages, itertools.count(first)))
        implementation.message_data_sent += len(data)
        for connection in implementation.connections:
            try:
                connection.write_data(data)
            except (OSError, TransportTerminated):
                connection.close()


def _on_the_wire(message, number):
    if message._has_header:
        header = message.header
        header.seq = number
        if header.frame_id is None:
            header.frame_id = "0"
    buffer = io.BytesIO()
    message.serialize(buffer)
    body = buffer.getvalue()
    return _LENGTH.pack(len(body)) + body


class _PatientConnection:
    """A connection to a subscriber, in the place of rospy's ``QueuedConnection``.

    While the subscriber does not keep up, the last ``limit`` messages wait for it.
    """

    def __init__(self, connection: Any, limit: int):
        self._connection = connection
        self._limit = limit
        self._lock = threading.Lock()
        self._waiting: deque[bytes] = deque()
        # The rest of a message that has begun; with it a thread is at work.
        self._rest = b""
        # A message waits for no other one; whether the subscriber asks for that or not.
        connection.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._connection, name)

    def write_data(self, data: bytes) -> None:
        """Send a message, now or later.

        Raises
        ------
        TransportTerminated
            The subscriber has hung up.
        """
        with self._lock:
            if self._rest:
                if len(self._waiting) == self._limit:
                    self._waiting.popleft()
                self._waiting.append(data)
                return
            self._rest = self._send(data)
            if self._rest:
                threading.Thread(target=self._catch_up, daemon=True).start()

    def _send(self, data):
        """Send as much as the socket takes; return the rest."""
        connection = self._connection
        sock = connection.socket
        if connection.done or sock is None:
            raise TransportTerminated("connection closed")
        try:
            sent = sock.send(data, _AT_ONCE)
        except BlockingIOError:
            return data
        except OSError as error:
            raise TransportTerminated(str(error)) from None
        connection.stat_bytes += sent
        if sent == len(data):
            connection.stat_num_msg += 1
            return b""
        return data[sent:]

    def _catch_up(self):
        try:
            poll = select.poll()
            poll.register(self._connection.socket, select.POLLOUT)
            while True:
                poll.poll(1000)
                if self._has_caught_up():
                    return
        # The socket may be closed by others at any moment.
        except (TransportTerminated, OSError, ValueError, AttributeError, TypeError):
            self._connection.close()

    def _has_caught_up(self):
        with self._lock:
            while True:
                self._rest = self._send(self._rest)
                if self._rest:
                    return False
                if not self._waiting:
                    return True
                self._rest = self._waiting.popleft()
