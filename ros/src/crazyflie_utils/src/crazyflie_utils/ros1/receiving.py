"""Reception of messages by subscribers of a handle, from publishers that may send invalid data.

Messages that cannot be decoded are dropped and the connection goes on, where rospy would connect
again and again. Publishers of another type and messages without end are disconnected, and a flood
is decoded in part. Messages that are needed only when they are looked up wait in the socket.
"""

import io
import math
import select
import socket
import struct
import threading
import time
from collections.abc import Callable, Hashable
from typing import Any

import genpy
import rospy
from rosgraph.network import (
    ROSHandshakeException,
    read_ros_handshake_header,
    write_ros_handshake_header,
)
from rospy.exceptions import TransportException, TransportInitError, TransportTerminated

from crazyflie_utils.topics import Condition

#: ``report(text, key)`` reports an error of a peer; ``key`` identifies its kind.
Report = Callable[[str, Hashable], None]

_LENGTH = struct.Struct("<I")

#: Longest message that is accepted (bytes): an uncompressed image of 20 megapixels.
MAX_MESSAGE_SIZE = 64_000_000
MAX_RATE = 2000.0  #: Rate of messages on one connection above which they are a flood (1/s).
_BURST = 200.0  #: Number of messages beyond `MAX_RATE` from which they are a flood.
_FLOOD_PERIOD = 0.005  #: Period in which one message of a flood is accepted (s).
_MAX_READS = 16  #: Largest number of reads of a socket in one period: a flood never ends.
PATIENCE = 0.15  #: Longest time for which messages wait to be collected (s).

_waiting: "set[Reception]" = set()


def collect_waiting() -> None:
    """Deliver the messages that wait on any connection of the process, in this thread."""
    # A copy: the connections' own threads add and remove theirs.
    for reception in tuple(_waiting):
        reception.collect()


class RateLimiter:
    """Detects whether a connection is flooded (a leaky bucket)."""

    def __init__(self) -> None:
        self._level = 0.0
        self._at = time.monotonic()

    def is_flooded(self, count: int) -> bool:
        """Count ``count`` more messages; return whether they are a flood."""
        now = time.monotonic()
        self._level = max(0.0, self._level - MAX_RATE * (now - self._at)) + count
        # Limited, so that the end of a long flood is detected as quickly as that of a short one.
        self._level = min(self._level, 2.0 * _BURST)
        self._at = now
        return self._level > _BURST


class Inbox:
    """Splits the data of a publisher, on a TCPROSTransport of rospy, into messages."""

    def __init__(self, connection: Any, report: Report):
        self.sock = connection.socket
        # Another thread may close the connection at any moment, which deletes the attribute.
        self._protocol = connection.protocol
        self._connection = connection
        self._report = report
        self._limiter = RateLimiter()
        self._part = bytearray()
        #: Error that ended the connection while messages were collected.
        self.end: TransportTerminated | None = None
        # Data that have come after the header of the connection.
        self._read = connection.read_buff.getvalue()[: connection.read_buff.tell()]
        self.sock.setblocking(True)

    def receive(self, limits_rate: bool) -> list[genpy.Message]:
        """Wait for data and return the messages that are complete; perhaps none.

        TransportTerminated if the publisher has hung up, or makes messages without end.
        """
        frames = self._take()
        if limits_rate and frames and self._limiter.is_flooded(len(frames)):
            time.sleep(_FLOOD_PERIOD)
            self._take_all(frames)
            if not getattr(self._protocol.recv_data_class, "lossless", False):
                topic = self._protocol.resolved_name
                self._report(
                    f"more than {MAX_RATE:g} messages a second on {topic}", ("flood", topic)
                )
                frames = frames[-1:]
        return self._decode(frames)

    def collect(self) -> tuple[list[genpy.Message], bool]:
        """Return the messages that are complete, without waiting, and whether more have come."""
        frames: list[bytes] = []
        has_more = False
        try:
            has_more = self._take_all(frames)
        except TransportTerminated as end:
            self.end = end
        return self._decode(frames), has_more

    def _take_all(self, frames):
        """Append the messages that have come, without waiting; return whether there are more."""
        for _ in range(_MAX_READS):
            read_before = self._connection.stat_bytes
            try:
                frames += self._take(socket.MSG_DONTWAIT)
            except BlockingIOError:
                return False
            if self._connection.stat_bytes - read_before < self._protocol.buff_size:
                return False
        return True

    def _decode(self, frames):
        messages = []
        for frame in frames:
            try:
                message = self._protocol.recv_data_class().deserialize(frame)
            except Exception as error:
                topic = self._protocol.resolved_name
                text = f"ignoring a message on {topic} that cannot be read: {error}"
                self._report(text, ("unreadable", topic))
            else:
                message._connection_header = self._connection.header
                messages.append(message)
        return messages

    def _take(self, flags=0):
        """Return the serialized messages that are complete after one read of the socket."""
        data, self._read = self._read or self._receive(flags), b""
        if self._part:
            self._part += data
            if len(self._part) < self._needed(self._part, 0):
                return []
            data = bytes(self._part)
            self._part.clear()
        frames, start = [], 0
        while (end := start + self._needed(data, start)) <= len(data):
            frames.append(data[start + _LENGTH.size : end])
            start = end
        self._part += data[start:]
        return frames

    def _receive(self, flags):
        try:
            data = self.sock.recv(self._protocol.buff_size, flags)
        except BlockingIOError:
            raise
        except OSError as error:
            raise TransportTerminated(str(error)) from None
        if not data:
            raise TransportTerminated("the publisher has hung up")
        self._connection.stat_bytes += len(data)
        return data

    def _needed(self, data, start):
        """Return the length of the message that begins at ``start``, with its prefix, bytes."""
        if len(data) - start < _LENGTH.size:
            return _LENGTH.size
        (size,) = _LENGTH.unpack_from(data, start)
        if size > MAX_MESSAGE_SIZE:
            topic = self._protocol.resolved_name
            text = f"disconnecting a publisher of {topic}: {size} bytes a message"
            self._report(text, ("long", topic))
            raise TransportTerminated("message too long")
        return _LENGTH.size + size


class Reception:
    """Receives from a connection, a TCPROSTransport of rospy, in the place of its own method.

    With ``limits_rate`` only the last message of every 5 ms is decoded in a flood of more than
    `MAX_RATE`; all of them, every 5 ms, of a message type with the attribute ``lossless``.

    While ``may_wait()``, messages wait until they are collected (before timers and service calls)
    or `PATIENCE` is over, unless they come as a flood: a thread that wakes up for each of them
    takes as long as what it does.
    """

    def __init__(
        self,
        connection: Any,
        report: Report,
        limits_rate: bool,
        may_wait: Condition,
        deliver: Callable[[list[genpy.Message], Any], None],
    ):
        self._connection = connection
        self._report = report
        self._limits_rate = limits_rate
        self._may_wait = may_wait
        self._deliver = deliver
        self._inbox: Inbox | None = None
        self._collected = -math.inf
        # Cleared for good: only the connection's own thread reads the socket from then on.
        self._waits = True
        # Held during delivery, which keeps the messages in order.
        self._lock = threading.RLock()

    def receive_once(self) -> list[genpy.Message]:
        """Wait for messages and return them; TransportTerminated if there will be none."""
        connection = self._connection
        if connection.socket is None:
            raise TransportException("connection not initialized")
        with self._lock:
            # After a reconnection there is another socket.
            if self._inbox is None or self._inbox.sock is not connection.socket:
                self._inbox = Inbox(connection, self._report)
                _waiting.add(self)
        messages: list[genpy.Message] = []
        while not (messages or connection.done or rospy.core.is_shutdown()):
            if self._inbox.end is not None:
                raise self._inbox.end
            if self._is_waiting():
                self._collect_later(self._inbox.sock)
            else:
                messages = self._inbox.receive(self._limits_rate)
        return self._count(messages)

    def collect(self) -> None:
        """Deliver the messages that wait, in this thread."""
        with self._lock:
            inbox = self._inbox
            if inbox is None or inbox.end is not None or not self._is_waiting():
                _waiting.discard(self)
                return
            messages, has_more = inbox.collect()
            self._collected = time.monotonic()
            self._waits = not has_more
            if messages:
                self._deliver(self._count(messages), self._connection)

    def _is_waiting(self):
        with self._lock:
            self._waits = self._waits and self._may_wait()
            return self._waits

    def _collect_later(self, sock):
        """Collect what has come, unless somebody else has done so recently."""
        rest = self._collected + PATIENCE - time.monotonic()
        if rest > 0.0:
            time.sleep(rest)
            return
        poll = select.poll()
        try:
            poll.register(sock, select.POLLIN)
        # Another thread may close the connection at any moment.
        except (OSError, ValueError) as error:
            raise TransportTerminated(str(error)) from None
        if poll.poll(1000):
            self.collect()

    def _count(self, messages):
        self._connection.stat_num_msg += len(messages)
        if self._connection.is_latched and messages:
            self._connection.latch = messages[-1]
        return messages


def validate_header(
    connection: Any,
    validate: Callable[[dict[str, str]], None],
    report: Report,
    header: dict[str, str],
) -> None:
    """Check the header of a publisher, in the place of ``validate``, the connection's own method.

    TransportInitError for a publisher of another type, which is disconnected for good.
    """
    if mismatch := _type_mismatch(connection.protocol, header):
        # Closed, so that rospy does not retry for ever.
        topic, peer = connection.protocol.resolved_name, header.get("callerid", "a publisher")
        connection.close()
        report(f"ignoring {peer} on {topic}: {mismatch}", ("type", topic, peer))
        raise TransportInitError(mismatch)
    try:
        validate(header)
    except TransportInitError:
        # For example from a publisher that is still starting. rospy must try again, but treats a
        # connection that has a socket as established.
        connection.socket.close()
        connection.socket = None
        raise


def _type_mismatch(protocol, header):
    """Return why a publisher's messages cannot be those of a subscription, or ""."""
    error = header.get("error", "")
    if "datatype/md5sum" in error or "types do not match" in error:
        return error
    expected = protocol.recv_data_class._md5sum
    if "error" in header or header.get("md5sum") in (expected, "*") or expected == "*":
        return ""
    return (
        f"{header.get('type')} [{header.get('md5sum')}] in the place of "
        f"{protocol.recv_data_class._type} [{expected}]"
    )


_HEADER_LIMIT = 5.0  #: Longest time for a peer to send its header (s).
MAX_PENDING = 32  #: Largest number of connections whose header has not come yet.


class Acceptor:
    """Replaces ``TCPROSServer._tcp_server_callback``, which reads one header at a time."""

    def __init__(self, server: Any, report: Report):
        self._server = server
        self._report = report
        self._places = threading.BoundedSemaphore(MAX_PENDING)

    def __call__(self, sock: Any, address: tuple[str, int]) -> None:
        """Answer a connection in a thread of its own, or close it if too many are pending."""
        if self._places.acquire(blocking=False):
            threading.Thread(target=self._answer, args=(sock, address), daemon=True).start()
        else:
            sock.close()

    def _answer(self, sock, address):
        try:
            sock.settimeout(_HEADER_LIMIT)
            header = read_ros_handshake_header(sock, io.BytesIO(), 4096)
            sock.settimeout(None)
            error = "no topic or service name detected"
            if rospy.core.is_shutdown_requested():
                error = "node shutting down"
            elif "topic" in header:
                error = self._server.topic_connection_handler(sock, address, header)
            elif "service" in header:
                error = self._server.service_connection_handler(sock, address, header)
            if error:
                write_ros_handshake_header(sock, {"error": error})
                raise ROSHandshakeException(error)
        except Exception as error:
            sock.close()
            if not rospy.core.is_shutdown_requested():
                text = f"refusing a connection from {address[0]}: {error!s:.250}"
                self._report(text, ("connection", str(error)[:250]))
        finally:
            self._places.release()
