"""All that is touched of rospy without being offered by it (seen in rospy 1.15 to 1.17).

Each of these is needed because a process may hold many nodes, which rospy does
not provide for. The rostests of this package notice when a rospy differs.
"""

import contextlib
import functools
import socket
import struct
import threading
import time
from collections.abc import Callable, Hashable

import genpy
import rosgraph.roslogging
import rospy
from rospy import rostime
from rospy.impl import registration, tcpros_base
from rospy.impl.tcpros_pubsub import TCPROSSub

_LENGTH = struct.Struct("<I")

_LONGEST = 16_000_000
"""The longest message that is taken, bytes."""

_FLOOD = 2000.0
"""Messages per second on one connection that are a flood,"""

_BURST = 200.0
"""when there are so many more of them than that."""

_REST = 0.005
"""In a flood, one message is taken and then none for this long, s."""

_HEADER_LIMIT = 5.0
"""How long, in s, who connects may take to say what for."""

_MOST_NEWCOMERS = 32
"""Connections that have not said yet what for."""

Report = Callable[[str, Hashable], None]
"""``report(text, key)`` takes note of what a peer did wrong; the key is that of the kind."""


@functools.cache
def never_connect_to_oneself() -> None:
    """Keep rospy from connecting a process's subscribers to its own publishers.

    Such messages are handed over within the process; over a socket every one
    would come twice.
    """
    implementation = rospy.topics._SubscriberImpl
    has_connection = implementation.has_connection

    def has_connection_or_is_own(self, endpoint_id):
        return endpoint_id == rospy.get_node_uri() or has_connection(self, endpoint_id)

    implementation.has_connection = has_connection_or_is_own


@functools.cache
def never_fail_to_log() -> None:
    """Keep a full disk, or a screen that is gone, from failing whoever logs.

    Python's own handlers do so; rospy's, for the screen, does not.
    """
    handler = rosgraph.roslogging.RosStreamHandler
    emit = handler.emit

    def emit_if_possible(self, record):
        with contextlib.suppress(OSError):
            emit(self, record)

    handler.emit = emit_if_possible


@functools.cache
def take_over_remappings() -> dict[str, str]:
    """Return the launch file's remappings, absolute name to absolute name.

    rospy no longer applies them: it would remap a name that has been remapped
    already, which goes wrong when two names are exchanged.
    """
    table = rospy.names.get_resolved_mappings()
    remappings = dict(table)
    table.clear()
    return remappings


def set_time(stamp: genpy.Time) -> None:
    """Set rospy's simulated clock, which stamps the log."""
    rostime._set_rostime(stamp)


def register_again() -> None:
    """Register all topics and services of this process with the master, which knows none."""
    listeners = registration.get_registration_listeners()
    topics, services = registration.get_topic_manager(), registration.get_service_manager()
    kinds = registration.Registration
    for kind, registered in (
        (kinds.PUB, topics.get_publications()),
        (kinds.SUB, topics.get_subscriptions()),
        (kinds.SRV, services.get_services()),
    ):
        for name, type_or_uri in registered:
            listeners.notify_added(name, type_or_uri, kind)


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

    def read_messages(self, buffer, messages, sock):
        frames = _take_frames(self, buffer, report)
        if limits_rate and frames and _flow(self).is_flooded(len(frames)):
            time.sleep(_REST)
            frames += _take_waiting(self, buffer, sock, report)
            if not getattr(self.recv_data_class, "each_counts", False):
                key = ("flood", self.resolved_name)
                report(f"more than {_FLOOD:g} messages a second on {self.resolved_name}", key)
                frames = frames[-1:]
        for frame in frames:
            try:
                messages.append(self.recv_data_class().deserialize(frame))
            except Exception as error:
                text = f"ignoring a message on {self.resolved_name} that cannot be read: {error}"
                report(text, ("unreadable", self.resolved_name))

    def validate_type(self, header):
        complaint = _complaint(self.protocol, header)
        if complaint:
            # Not again and again.
            topic, peer = self.protocol.resolved_name, header.get("callerid", self.endpoint_id)
            self.close()
            report(f"ignoring {peer} on {topic}: {complaint}", ("type", topic, peer))
            raise rospy.exceptions.TransportInitError(complaint)
        validate_header(self, header)

    TCPROSSub.read_messages = read_messages
    tcpros_base.TCPROSTransport._validate_header = validate_type


def _flow(protocol):
    if not hasattr(protocol, "flow"):
        protocol.flow = _Flow()
    return protocol.flow


def _take_frames(protocol, buffer, report):
    """Return what is complete of the messages in a buffer, and leave the rest in it."""
    filled = buffer.tell()
    buffer.seek(0)
    size = _size(protocol, buffer.read(_LENGTH.size), report)
    if filled < _LENGTH.size + size:
        buffer.seek(filled)
        return []
    buffer.seek(0)
    data = buffer.read(filled)
    frames, start = [], 0
    while filled - start >= _LENGTH.size:
        end = start + _LENGTH.size + _LENGTH.unpack_from(data, start)[0]
        if end > filled:
            break
        frames.append(data[start + _LENGTH.size : end])
        start = end
    buffer.seek(0)
    buffer.truncate()
    buffer.write(data[start:])
    return frames


def _size(protocol, head, report):
    (size,) = _LENGTH.unpack(head)
    if size > _LONGEST:
        topic = protocol.resolved_name
        report(f"disconnecting a publisher of {topic}: {size} bytes a message", ("long", topic))
        raise rospy.exceptions.TransportTerminated("message too long")
    return size


def _take_waiting(protocol, buffer, sock, report):
    frames = []
    # As long as a flood lasts there is always more; a millionth part of it is enough.
    for _ in range(16):
        try:
            data = sock.recv(protocol.buff_size, socket.MSG_DONTWAIT)
        except BlockingIOError:
            break
        if not data:
            break
        buffer.write(data)
        if buffer.tell() >= _LENGTH.size:
            frames += _take_frames(protocol, buffer, report)
    return frames


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


@functools.cache
def bear_hostile_newcomers(report: Report) -> None:
    """Let nobody who connects to this process, and then is silent or talks nonsense, delay others.

    rospy reads what they want one after the other, without a limit of time.
    """
    handler = tcpros_base.TCPROSServer._tcp_server_callback
    read_header = tcpros_base.read_ros_handshake_header
    places = threading.BoundedSemaphore(_MOST_NEWCOMERS)

    def answer(self, sock, address):
        try:
            handler(self, sock, address)
        finally:
            places.release()

    def answer_in_a_thread(self, sock, address):
        if places.acquire(blocking=False):
            threading.Thread(target=answer, args=(self, sock, address), daemon=True).start()
        else:
            sock.close()

    def read_header_in_time(sock, buffer, size):
        before = sock.gettimeout()
        sock.settimeout(_HEADER_LIMIT)
        try:
            return read_header(sock, buffer, size)
        finally:
            sock.settimeout(before)

    def warn(text, *arguments):
        text = (text % arguments if arguments else text)[:300]
        report(text, ("newcomer", text))

    tcpros_base.TCPROSServer._tcp_server_callback = answer_in_a_thread
    server = tcpros_base._tcpros_server
    if server is not None and server.tcp_ros_server is not None:
        # It holds the method that it was started with.
        server.tcp_ros_server.inbound_handler = server._tcp_server_callback
    tcpros_base.read_ros_handshake_header = read_header_in_time
    tcpros_base.logwarn = warn
