"""Topics within a process, and the interface of the process to other processes.

Subscribers in the process are called with the published object itself, and must therefore not
change it. Messages are sent to other processes only if these subscribe. A `Transport` sends them:
`RosTransport` with rospy, or `FakeTransport` in unit tests. Everything else of a `NodeHandle` is
the same for both.
"""

import io
import secrets
import struct
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import genpy

LENGTH = struct.Struct("<I")  #: Before each message on a connection: its length (bytes).

Receiver = Callable[[Any], None]
Condition = Callable[[], bool]
#: ``serve(request, is_withdrawn)`` returns the future response of a service; ``is_withdrawn()``
#: returns whether the caller has given up the call.
Serve = Callable[[Any, Condition], Future[Any]]


def never() -> bool:
    """Return False."""
    return False


def framed(message: genpy.Message, number: int | None = None) -> bytes:
    """Return a message as it is sent: serialized, behind its length.

    As rospy does, it gets a sequence number, if there is one, and a frame.
    """
    if message._has_header:
        header = message.header
        if number is not None:
            header.seq = number
        if header.frame_id is None:
            header.frame_id = "0"
    buffer = io.BytesIO()
    message.serialize(buffer)
    body = buffer.getvalue()
    return LENGTH.pack(len(body)) + body


class ExternalPublisher(ABC):
    """Publishes one topic to other processes."""

    #: Called with every message that is published, also if nobody outside subscribes, and with what
    #: `publish` has returned, or None.
    note: Callable[[genpy.Message, bytes | None], None] | None = None

    @abstractmethod
    def has_subscribers(self) -> bool:
        """Return whether another process subscribes."""

    @abstractmethod
    def publish(self, *messages: genpy.Message) -> bytes | None:
        """Send messages to other processes.

        Return the last one as it was sent, see `framed`, if that is known.
        """

    @abstractmethod
    def close(self) -> None:
        """End the publication."""


class ExternalSubscriber(ABC):
    """Receives one topic from other processes."""

    @abstractmethod
    def has_publishers(self) -> bool:
        """Return whether another process publishes."""

    @abstractmethod
    def close(self) -> None:
        """End the subscription."""


class Transport(ABC):
    """Parameters, topics, services, logging and life time, by absolute names."""

    #: Whether this thread runs callbacks, which must not wait for the master.
    is_in_callback: Condition = staticmethod(never)
    #: Calls what waits for the master: ``outside(call, *arguments)``; see `Tasks.outside`.
    outside: Callable[..., Any] = staticmethod(lambda call, *arguments: call(*arguments))
    time: Callable[[], float]  #: The clock of the process, s.

    def starting(self) -> AbstractContextManager[None]:
        """Return a with block that initializes nodes; other processes see them at its end."""
        return nullcontext()

    @abstractmethod
    def remap(self, name: str) -> str:
        """Return the name to which the launch file remaps ``name``."""

    @abstractmethod
    def get_param(self, name: str) -> Any:
        """Return the raw value of a parameter, a dictionary of a namespace; KeyError without."""

    @abstractmethod
    def set_param(self, name: str, value: Any) -> None:
        """Set a parameter."""

    def set_param_later(self, name: str, value: Any) -> Future[None]:
        """Set a parameter soon, without waiting for the master; by default, at once.

        The future is done in any thread.
        """
        self.set_param(name, value)
        done: Future[None] = Future()
        done.set_result(None)
        return done

    @abstractmethod
    def advertise(self, topic: str, message_type: type, latch: bool) -> ExternalPublisher:
        """Announce a topic to other processes."""

    @abstractmethod
    def subscribe(
        self, topic: str, message_type: type, deliver: Receiver, may_wait: Condition = never
    ) -> ExternalSubscriber:
        """Call ``deliver(message)`` with the messages of other processes.

        That includes latched ones; a topic may be subscribed more than once. While ``may_wait()``,
        messages may be held back until `collect` is called.
        """

    def peer_changes(self) -> int | None:
        """Return a number that changes when a subscriber or publisher comes or goes, if known."""
        return None

    def collect(self) -> None:  # noqa: B027 - Nothing waits in most transports.
        """Deliver the messages that wait, of all topics; not in a callback."""

    @abstractmethod
    def advertise_service(self, name: str, service_type: type, serve: Serve) -> Callable[[], None]:
        """Answer calls of a service with the outcome of a future; see `Serve`.

        The caller gets a `ServiceError`, also if the process ends, or if `time` stands still.
        Returns a function that ends the service.
        """

    @abstractmethod
    def call_service(
        self, name: str, service_type: type, request: Any, limit: float, start_limit: float
    ) -> Future[Any]:
        """Call a service and return at once; see `NodeHandle.call_service`."""

    @abstractmethod
    def service_nodes(self) -> dict[str, str]:
        """Return every service that any node offers -> the name of its node."""

    def living_node(self, name: str) -> str | None:
        """Return where a node of another process runs; None if it does not answer, by default."""
        return None

    def random_seed(self) -> int:
        """Return 32 random bits."""
        return secrets.randbits(32)

    @abstractmethod
    def log(self, level: str, text: str) -> None:
        """Log at ``level``: debug, info, warn, error or fatal."""

    def clock_was_set(self, stamp: genpy.Time) -> None:  # noqa: B027 - Most have no clock.
        """Set the transport's clock: this process, which publishes /clock, moved to ``stamp``."""


class Topic:
    """One topic as this process sees it."""

    def __init__(self, name: str, message_type: type[genpy.Message]):
        self.name = name
        self.message_type = message_type
        self.publishers: list[Publisher] = []
        self.receivers: list[Receiver] = []


class Publisher:
    """A publisher of a topic."""

    def __init__(self, topic: Topic, external: ExternalPublisher, latch: bool):
        self.latched: genpy.Message | None = None  #: Last message, for late subscribers.
        self._topic = topic
        self._external = external
        self._latch = latch
        self._is_closed = False
        topic.publishers.append(self)

    @property
    def topic(self) -> str:
        """Name of the topic, absolute."""
        return self._topic.name

    def has_subscribers(self, excluding: int = 0) -> bool:
        """Return whether there are subscribers, not counting ``excluding`` ones of this process."""
        return self.is_read_here(excluding) or self.is_heard_outside()

    def is_heard_outside(self) -> bool:
        """Return whether another process subscribes."""
        return self._external.has_subscribers()

    def is_read_here(self, excluding: int = 0) -> bool:
        """Return whether this process has more receivers than ``excluding``."""
        return len(self._topic.receivers) > excluding

    def publish(self, message: genpy.Message, before: Sequence[genpy.Message] = ()) -> None:
        """Send a message of the topic's type (or TypeError), which must not be changed afterwards.

        The messages ``before`` it are sent to other processes only, all at once.
        """
        topic = self._topic
        if not isinstance(message, topic.message_type):
            raise TypeError(
                f"topic {topic.name} carries {topic.message_type._type}, "
                f"not {type(message).__name__}"
            )
        if self._is_closed:
            return
        external, sent = self._external, None
        if self._latch:
            self.latched = message
        if self._latch or external.has_subscribers():
            sent = external.publish(*before, message)
        if external.note is not None:
            external.note(message, sent)
        for receiver in topic.receivers:
            receiver(message)

    def close(self) -> None:
        """End the publication; later messages, and the latched one, are lost."""
        if not self._is_closed:
            self._is_closed = True
            self._topic.publishers.remove(self)
            self._external.close()


class Subscriber:
    """One subscription of a topic."""

    def __init__(self, topic: Topic, receiver: Receiver, external: ExternalSubscriber):
        self._topic = topic
        self._receiver = receiver
        self._external = external

    def has_publishers(self) -> bool:
        """Return whether there are publishers, in this process or in others."""
        return bool(self._topic.publishers) or self._external.has_publishers()

    def caller(self, message: genpy.Message) -> str:
        """Return the name of the node of another process that sent a message, or ""."""
        header = getattr(message, "_connection_header", None) or {}
        # A node of this process may have passed on what it received on another topic.
        is_here = header.get("topic", self._topic.name) == self._topic.name
        return header.get("callerid", "") if is_here else ""

    def close(self) -> None:
        """End the subscription."""
        # Replaced, not changed: a message may just be delivered to the other receivers.
        receivers = self._topic.receivers
        self._topic.receivers = [each for each in receivers if each is not self._receiver]
        self._external.close()


class Topics:
    """All topics of a process; TypeError for a topic that already has another type."""

    def __init__(self, transport: Transport):
        self._transport = transport
        self._topics: dict[str, Topic] = {}

    def publisher(self, name: str, message_type: type[genpy.Message], latch: bool) -> Publisher:
        """Return a publisher; a latched one repeats its last message to late subscribers."""
        topic = self._topic(name, message_type)
        return Publisher(topic, self._transport.advertise(name, message_type, latch), latch)

    def subscribe(
        self,
        name: str,
        message_type: type[genpy.Message],
        receiver: Receiver,
        outside_type: type[genpy.Message] | None = None,
        may_wait: Condition = never,
    ) -> Subscriber:
        """Call ``receiver(message)`` for every message on a topic.

        Messages from outside come as ``outside_type``, a subclass of ``message_type``, if given;
        ``may_wait`` is that of `Transport.subscribe`.
        """
        topic = self._topic(name, message_type)
        topic.receivers.append(receiver)
        for publisher in topic.publishers:
            if publisher.latched is not None:
                receiver(publisher.latched)
        # One subscription for each receiver, so that a late one gets the latched message of another
        # process; the connection is shared.
        external = self._transport.subscribe(name, outside_type or message_type, receiver, may_wait)
        return Subscriber(topic, receiver, external)

    def _topic(self, name, message_type):
        topic = self._topics.setdefault(name, Topic(name, message_type))
        if topic.message_type is not message_type:
            raise TypeError(
                f"topic {name} carries {topic.message_type._type}, not {message_type._type}"
            )
        return topic


class LatestMessage:
    """The latest message of a topic, which waits until ``callback(message)`` is called with it."""

    def __init__(
        self, topics: Topics, name: str, message_type: type, callback: Callable[[Any], None]
    ):
        self._callback = callback
        self._waiting: deque[Any] = deque(maxlen=1)
        #: The subscription, whose messages may wait until `Transport.collect`.
        self.subscriber = topics.subscribe(
            name, message_type, self._waiting.append, may_wait=lambda: True
        )

    def deliver(self) -> None:
        """Call the callback with the latest message, if it is new."""
        if self._waiting:
            self._callback(self._waiting.pop())
