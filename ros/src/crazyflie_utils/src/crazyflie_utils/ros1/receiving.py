"""How messages come into a process, whatever publishers send; more of what rospy does not offer."""

import functools
import math
import select
import socket
import struct
import threading
import time
from collections.abc import Callable
from typing import Any

import genpy
import rospy
from rospy.exceptions import TransportException, TransportTerminated
from rospy.impl import registration, tcpros_base
from rospy.impl.tcpros_pubsub import TCPROSSub

from crazyflie_utils.ros1.internals import Report

_LENGTH = struct.Struct("<I")

_LONGEST = 16_000_000
"""The longest message that is taken, bytes."""

_FLOOD = 2000.0
"""Messages per second on one connection that are a flood,"""

_BURST = 200.0
"""when there are so many more of them than that."""

_REST = 0.005
"""In a flood, one message is taken and then none for this long, s."""

_TURNS = 16
"""How often a socket is read for what waits there: a flood never ends, but a millionth part of it
is enough."""

_PAUSE = 0.05
"""How long messages that are read lazily wait to be collected, at most, s;"""

_LATEST_PAUSE = 0.15
"""and where only the last one counts: less often than their nodes collect them by themselves."""


class _Flow:
    """Tells whether a connection is flooded."""

    def __init__(self) -> None:
        self._level = 0.0
        self._at = time.monotonic()

    def is_flooded(self, count: int) -> bool:
        """Take note of ``count`` more messages."""
        now = time.monotonic()
        self._level = max(0.0, self._level - _FLOOD * (now - self._at)) + count
        # A flood of hours is forgotten as quickly as one of a second.
        self._level = min(self._level, 2.0 * _BURST)
        self._at = now
        return self._level > _BURST


@functools.cache
def bear_hostile_publishers(report: Report, limits_rate: bool) -> None:
    """Receive such that no publisher of a topic can do more than be ignored.

    Messages that cannot be decoded are dropped, and the connection goes on; rospy would
    connect again and again. A publisher of another type, or of messages without end, is
    disconnected.

    Parameters
    ----------
    report : callable
    limits_rate : bool
        Decode only the last message of every 5 ms in a flood of more than 2000 a second on
        one connection; all of them, but in turns of 5 ms, of a type that says
        ``each_counts``.
    """
    validate_header = tcpros_base.TCPROSTransport._validate_header
    receive_once = tcpros_base.TCPROSTransport.receive_once

    def receive(self):
        if not isinstance(self.protocol, TCPROSSub):
            return receive_once(self)
        if self.socket is None:
            raise TransportException("connection not initialized")
        inbox = _inbox(self, report)
        if inbox.is_lazy:
            if not inbox.wait():
                return []
            if reminders := inbox.reminders:
                for remind in reminders:
                    remind()
                return []
            return _note(self, inbox.take_waiting(_TURNS))
        messages: list[genpy.Message] = []
        while not (messages or self.done or rospy.core.is_shutdown()):
            frames = inbox.take()
            if limits_rate and frames and inbox.flow.is_flooded(len(frames)):
                frames = _calm(inbox, frames, report)
            messages = inbox.decoded(frames)
        return _note(self, messages)

    def validate_type(self, header):
        complaint = _complaint(self.protocol, header)
        if complaint:
            # Not again and again.
            topic, peer = self.protocol.resolved_name, header.get("callerid", self.endpoint_id)
            self.close()
            report(f"ignoring {peer} on {topic}: {complaint}", ("type", topic, peer))
            raise rospy.exceptions.TransportInitError(complaint)
        try:
            validate_header(self, header)
        except rospy.exceptions.TransportInitError:
            # Such as of a publisher that is not quite there. rospy means to try again, but takes a
            # connection that has a socket for one that was made.
            self.socket.close()
            self.socket = None
            raise

    tcpros_base.TCPROSTransport.receive_once = receive
    tcpros_base.TCPROSTransport._validate_header = validate_type


def read_lazily(
    subscriber: rospy.Subscriber, is_lazy: bool, remind: Callable[[], None] | None = None
) -> None:
    """Let messages wait for `collect`, or for 50 ms, unless others subscribe here, too.

    Then they are delivered; or after 150 ms ``remind()`` is called, with which only the last one
    is delivered.
    """
    # It is shared with those who have subscribed here before, or will.
    implementation = subscriber.impl
    implementation.is_lazy = is_lazy
    if remind is not None:
        implementation.reminders = [*getattr(implementation, "reminders", ()), remind]


def collect(subscriber: rospy.Subscriber) -> None:
    """Call back, in this thread, for messages that wait."""
    implementation = subscriber.impl
    if implementation is None:
        return
    for connection in implementation.connections:
        inbox = getattr(connection, "inbox", None)
        if inbox is not None and inbox.sock is connection.socket and inbox.is_lazy:
            # Once: in a flood the connection's own thread is at work as well, and whoever looks
            # something up has no time for all of it.
            messages = _note(connection, inbox.take_waiting(1))
            if messages:
                implementation.receive_callback(messages, connection)


def _note(connection, messages):
    connection.stat_num_msg += len(messages)
    if connection.is_latched and messages:
        connection.latch = messages[-1]
    return messages


def _inbox(connection, report):
    """Return the inbox of a connection's socket; after a reconnection it is another one."""
    inbox = getattr(connection, "inbox", None)
    if inbox is None or inbox.sock is not connection.socket:
        # What has come behind the header of the connection.
        read = connection.read_buff.getvalue()[: connection.read_buff.tell()]
        inbox = connection.inbox = _Inbox(connection, read, report)
    return inbox


def _calm(inbox, frames, report):
    """Return what is taken in a flood."""
    protocol = inbox.protocol
    time.sleep(_REST)
    for _ in range(_TURNS):
        try:
            frames += inbox.take(socket.MSG_DONTWAIT)
        except BlockingIOError:
            break
    if getattr(protocol.recv_data_class, "each_counts", False):
        return frames
    key = ("flood", protocol.resolved_name)
    report(f"more than {_FLOOD:g} messages a second on {protocol.resolved_name}", key)
    return frames[-1:]


class _Inbox:
    """Cuts what a publisher sends into messages.

    Parameters
    ----------
    connection : rospy.impl.tcpros_base.TCPROSTransport
    read : bytes
        What has been read from its socket already.
    report : callable
    """

    def __init__(self, connection: Any, read: bytes, report: Report):
        self.flow = _Flow()
        self.sock = connection.socket
        # The connection forgets it when it is closed, which another thread may do at any moment.
        self.protocol = connection.protocol
        self._connection = connection
        self._report = report
        self._part = bytearray()
        self._read = read
        self.sock.setblocking(True)
        # Of what is read lazily.
        self._lock = threading.Lock()
        self._collected = -math.inf
        self._is_behind = True
        self._end: TransportTerminated | None = None

    @property
    def is_lazy(self) -> bool:
        """Whether messages may wait; see `read_lazily`."""
        implementation = self._implementation()
        return getattr(implementation, "is_lazy", False) and len(implementation.callbacks) == 1

    @property
    def reminders(self) -> list[Callable[[], None]]:
        """Who is told of messages that have waited; see `read_lazily`."""
        return getattr(self._implementation(), "reminders", [])

    def _implementation(self):
        return registration.get_topic_manager().get_subscriber_impl(self.protocol.resolved_name)

    def wait(self) -> bool:
        """Wait a little, and then for data, unless somebody has collected it meanwhile.

        Returns
        -------
        bool
            Whether nobody has.

        Raises
        ------
        TransportTerminated
            The publisher has hung up, or makes messages without end.
        """
        if self._end is not None:
            raise self._end
        if not self._is_behind:
            pause = _LATEST_PAUSE if self.reminders else _PAUSE
            rest = self._collected + pause - time.monotonic()
            time.sleep(rest if rest > 0.0 else pause)
            if time.monotonic() < self._collected + pause:
                return False
        try:
            poll = select.poll()
            poll.register(self.sock, select.POLLIN)
            poll.poll(1000)
        # It may be closed by others at any moment.
        except (OSError, ValueError) as error:
            raise TransportTerminated(str(error)) from None
        return True

    def take_waiting(self, turns: int) -> list[genpy.Message]:
        """Return the messages that are there, read at most so many times.

        A hang-up is left to `wait`.
        """
        frames: list[bytes] = []
        self._collected = time.monotonic()
        with self._lock:
            try:
                for _ in range(turns):
                    frames += self.take(socket.MSG_DONTWAIT)
                    if not self._is_behind:
                        break
            except BlockingIOError:
                self._is_behind = False
            except TransportTerminated as end:
                self._end = end
        return self.decoded(frames[-1:] if self.reminders else frames)

    def decoded(self, frames: list[bytes]) -> list[genpy.Message]:
        """Return messages without those that cannot be decoded."""
        messages: list[genpy.Message] = []
        protocol, header = self.protocol, self._connection.header
        for frame in frames:
            try:
                message = protocol.recv_data_class().deserialize(frame)
            except Exception as error:
                topic = protocol.resolved_name
                text = f"ignoring a message on {topic} that cannot be read: {error}"
                self._report(text, ("unreadable", topic))
            else:
                message._connection_header = header
                messages.append(message)
        return messages

    def take(self, flags: int = 0) -> list[bytes]:
        """Wait for data and return the messages that are complete, serialized.

        Raises
        ------
        BlockingIOError
            By the ``flags`` nothing is waited for.
        TransportTerminated
            The publisher has hung up, or makes messages without end.
        """
        data, self._read = self._read or self._receive(flags), b""
        if self._part:
            self._part += data
            if len(self._part) < self._needed(self._part):
                return []
            data = bytes(self._part)
            self._part.clear()
        frames, start, filled = [], 0, len(data)
        while filled - start >= _LENGTH.size:
            end = start + self._needed(data, start)
            if end > filled:
                break
            frames.append(data[start + _LENGTH.size : end])
            start = end
        self._part += data[start:]
        return frames

    def _receive(self, flags):
        try:
            data = self.sock.recv(self.protocol.buff_size, flags)
        except BlockingIOError:
            raise
        except OSError as error:
            raise TransportTerminated(str(error)) from None
        if not data:
            raise TransportTerminated("the publisher has hung up")
        self._connection.stat_bytes += len(data)
        # A great part of what the socket holds.
        self._is_behind = len(data) > self.protocol.buff_size // 2
        return data

    def _needed(self, data, start=0):
        """Return how long a message is, with its length."""
        if len(data) - start < _LENGTH.size:
            return _LENGTH.size
        (size,) = _LENGTH.unpack_from(data, start)
        if size > _LONGEST:
            topic = self.protocol.resolved_name
            text = f"disconnecting a publisher of {topic}: {size} bytes a message"
            self._report(text, ("long", topic))
            raise TransportTerminated("message too long")
        return _LENGTH.size + size


def _complaint(protocol, header):
    """Return why a publisher's messages cannot be those of a subscription, or ""."""
    if not isinstance(protocol, TCPROSSub):
        return ""
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
