"""How messages come into a process, whatever publishers send; more of what rospy does not offer."""

import functools
import socket
import struct
import time
from typing import Any

import genpy
import rospy
from rospy.exceptions import TransportException, TransportTerminated
from rospy.impl import tcpros_base
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
