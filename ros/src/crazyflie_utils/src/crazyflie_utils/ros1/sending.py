"""Connections to subscribers, to which messages are sent at once and without waiting.

rospy either sends in the publisher's thread, which a frozen subscriber blocks, or uses a thread for
every subscriber, which takes more time than the message. Here the publisher's thread sends as much
as the socket accepts; only a subscriber that does not keep up gets a thread.
"""

import io
import select
import socket
import struct
import threading
from collections import deque
from typing import Any

import genpy
from rospy.exceptions import TransportTerminated

_LENGTH = struct.Struct("<I")

_NO_WAIT = socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL


def serialized(message: genpy.Message, number: int) -> bytes:
    """Return a serialized message, with a sequence number in its header, if it has one."""
    if message._has_header:
        header = message.header
        header.seq = number
        if header.frame_id is None:
            header.frame_id = "0"
    buffer = io.BytesIO()
    message.serialize(buffer)
    body = buffer.getvalue()
    return _LENGTH.pack(len(body)) + body


class NonBlockingConnection:
    """A connection to a subscriber, which replaces rospy's ``QueuedConnection``.

    While the subscriber does not keep up, the last ``limit`` messages (0: all) wait for it.
    """

    def __init__(self, connection: Any, limit: int):
        self._connection = connection
        self._lock = threading.Lock()
        self._waiting: deque[bytes] = deque(maxlen=limit or None)
        # The rest of a message that was sent in part; while there is one, a thread sends.
        self._rest = b""
        # Not only where the subscriber asks for it: messages above 490 bytes wait up to 40 ms.
        connection.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._connection, name)

    def write_data(self, data: bytes) -> None:
        """Send a message, now or later; TransportTerminated if the subscriber has hung up."""
        with self._lock:
            if self._rest:
                self._waiting.append(data)
                return
            self._rest = self._send(data)
            if self._rest:
                threading.Thread(target=self._catch_up, daemon=True).start()

    def _send(self, data):
        """Send as much as the socket accepts; return the rest."""
        connection = self._connection
        sock = connection.socket
        if connection.done or sock is None:
            raise TransportTerminated("connection closed")
        try:
            sent = sock.send(data, _NO_WAIT)
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
