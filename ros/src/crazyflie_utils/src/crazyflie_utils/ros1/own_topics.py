"""rospy's side of the topics of handles: derived from rospy's classes, for these topics only.

A topic that rospy subscribes to or publishes in this process already stays unchanged.

rospy either sends in the publisher's thread, which a frozen subscriber blocks, or uses a thread for
every subscriber, which takes more time than the message. Here the publisher's thread sends as much
as the socket accepts; only a subscriber that does not keep up gets a thread.
"""

import select
import socket
import threading
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

import genpy
import rospy
from rospy.exceptions import TransportTerminated
from typing_extensions import override

from crazyflie_utils.ros1 import master_watch
from crazyflie_utils.ros1.receiving import Reception, Report, validate_header
from crazyflie_utils.topics import Condition, Receiver, framed

_NO_WAIT = socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL


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
        # Set even if the subscriber does not ask for it: messages above 490 bytes would wait up to
        # 40 ms.
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
        # Another thread may close the socket at any moment.
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


class OwnCallback:
    """A callback of a handle, which ignores messages that handles of this process publish.

    Those are passed by a call, if ``is_handed_over()``. They also come by a socket without
    `skip_self_connections`, or if rospy also subscribes to the topic in this process. ``may_wait``
    is that of `Transport.subscribe`.
    """

    def __init__(self, deliver: Receiver, is_handed_over: Condition, may_wait: Condition):
        self.may_wait = may_wait
        self._deliver = deliver
        self._is_handed_over = is_handed_over

    def __call__(self, message: genpy.Message) -> None:
        """Deliver a message."""
        header: dict[str, str] = getattr(message, "_connection_header", None) or {}
        if header.get("callerid") != rospy.get_name() or not self._is_handed_over():
            self._deliver(message)


class PeerChanges:
    """How often a connection of these topics has come or gone in this process."""

    count = 0


class _Counted(rospy.topics._TopicImpl):
    """Counts its changes, and asks the system for none if there are no connections."""

    @override
    def check(self) -> None:
        # A system call for each topic, twice a second and at each update of the master's.
        before = self.connections
        if before:
            super().check()
            if self.connections is not before:
                PeerChanges.count += 1

    @override
    def add_connection(self, c: Any) -> bool:
        is_added = super().add_connection(c)
        PeerChanges.count += 1
        return bool(is_added)

    @override
    def remove_connection(self, c: Any) -> None:
        super().remove_connection(c)
        PeerChanges.count += 1


class OwnSubscription(_Counted, rospy.topics._SubscriberImpl):
    """rospy's side of a topic, by remapped name, that handles subscribe to, with these patches.

    See `OwnCallback` and `receiving.Reception`.
    """

    def __init__(
        self,
        name: str,
        message_type: type,
        is_handed_over: Condition,
        report: Report,
        limits_rate: bool,
        patches: frozenset[str],
    ):
        super().__init__(name, message_type)
        # The name is remapped already; rospy would remap it once more.
        self.resolved_name = self.name = name
        self.tcp_nodelay = True
        self._is_handed_over = is_handed_over
        self._report = report
        self._limits_rate = limits_rate
        self._patches = patches

    def _is_own(self):
        """Return whether only handles have subscribed."""
        return all(isinstance(callback, OwnCallback) for callback, _ in self.callbacks or ())

    def _may_wait(self):
        return self._is_own() and all(callback.may_wait() for callback, _ in self.callbacks or ())

    @override
    def has_connection(self, endpoint_id: str) -> bool:
        if "skip_self_connections" in self._patches and endpoint_id == rospy.get_node_uri():
            if self._is_own() and self._is_handed_over():
                return True
        return super().has_connection(endpoint_id)

    @override
    def add_callback(self, cb: Callable[..., None], cb_args: Any) -> None:
        super().add_callback(cb, cb_args)
        if not isinstance(cb, OwnCallback) and self._is_handed_over():
            master_watch.update_publishers(self.resolved_name, [rospy.get_node_uri()])

    @override
    def add_connection(self, c: Any) -> bool:
        with self.c_lock:
            if "connect_once" in self._patches and any(
                each.endpoint_id == c.endpoint_id and not each.done for each in self.connections
            ):
                return False
            if "harden_subscribers" in self._patches and self._is_own():
                c.reception = Reception(
                    c, self._report, self._limits_rate, self._may_wait, self.receive_callback
                )
                c.receive_once = c.reception.receive_once
                c._validate_header = partial(validate_header, c, c._validate_header, self._report)
            return super().add_connection(c)


class OwnPublication(_Counted, rospy.topics._PublisherImpl):
    """rospy's side of a topic that handles publish."""

    def __init__(self, name: str, message_type: type, queue_size: int, latch: bool):
        super().__init__(name, message_type)
        self.resolved_name = self.name = name
        # Set before the registration, since subscribers connect at once.
        self._limit = queue_size
        self.is_latch = latch

    @override
    def set_queue_size(self, queue_size: int) -> None:
        # With rospy's own attribute, it would make a thread for each connection.
        self._limit = queue_size

    @override
    def add_connection(self, c: Any) -> bool:
        return super().add_connection(NonBlockingConnection(c, self._limit))

    def send(self, messages: tuple[genpy.Message, ...]) -> bytes | None:
        """Publish messages that are of the topic's type, all at once.

        Return the data that were sent, if it was one message.
        """
        with self.publock:
            if self.is_latch:
                self.latch = messages[-1]
            if not self.connections:
                return None
            first = self.seq + 1
            self.seq += len(messages)
            data = b"".join(framed(each, first + k) for k, each in enumerate(messages))
            self.message_data_sent += len(data)
            for connection in self.connections:
                try:
                    connection.write_data(data)
                except (OSError, rospy.exceptions.TransportTerminated):
                    connection.close()
            return data if len(messages) == 1 else None
