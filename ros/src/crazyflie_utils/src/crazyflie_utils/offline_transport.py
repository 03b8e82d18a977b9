"""The outside of a process without ROS: its parameters, what it publishes, what is delivered."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import genpy
from rosmaster.paramserver import ParamDictionary

from crazyflie_utils.refusal import ServiceError
from crazyflie_utils.topics import (
    Condition,
    ExternalPublisher,
    ExternalSubscriber,
    Receiver,
    Serve,
    Transport,
    framed,
    never,
)


class _Publication(ExternalPublisher):
    def __init__(self, transport: "OfflineTransport", topic: str):
        self._transport, self._topic = transport, topic
        self.messages: list[genpy.Message] = []

    def has_subscribers(self) -> bool:
        return True

    def publish(self, *messages: genpy.Message) -> bytes | None:
        sent = None
        for message in messages:
            # A message that cannot be serialized must fail here as it would on a wire.
            sent = framed(message)
            self.messages.append(message)
            self._transport.on_publish(self._topic, message)
        return sent

    def close(self) -> None:
        pass


class _Subscription(ExternalSubscriber):
    def __init__(self, transport: "OfflineTransport", topic: str, deliver: Receiver):
        self._transport = transport
        self._topic = topic
        self._deliver = deliver

    def has_publishers(self) -> bool:
        return self._transport.is_published(self._topic)

    def close(self) -> None:
        self._transport.subscribers[self._topic].remove(self._deliver)
        self._transport.changes += 1


class OfflineTransport(Transport):
    """An outside world that records everything and does nothing by itself.

    The ``parameters`` are full name to raw value. Every subscribed topic has publishers there,
    except those in ``unpublished``.
    """

    def __init__(self, parameters: dict[str, Any]):
        self.parameters = dict(parameters)
        #: All names of parameters, topics and services that nodes have used.
        self.names: set[str] = set()
        self.remappings: dict[str, str] = {}  #: As those of a launch file.
        self.publishers: dict[str, _Publication] = {}
        #: Called with the topic and each message that leaves the process.
        self.on_publish: Callable[[str, genpy.Message], None] = lambda topic, message: None
        self.subscribers: dict[str, list[Receiver]] = {}
        #: publisher_types, subscriber_types: Types by topic.
        self.publisher_types: dict[str, Any] = {}
        self.subscriber_types: dict[str, Any] = {}
        self.unpublished: set[str] = set()
        #: How often a publisher or a subscription has come, or a subscription gone.
        self.changes = 0
        self.services: dict[str, Callable[[Any], Future[Any]]] = {}
        self.service_types: dict[str, type] = {}
        self.log_records: list[tuple[str, str]] = []
        #: Called with level and text of what the nodes log.
        self.on_log: Callable[[str, str], None] = lambda level, text: None

    def deliver(self, topic: str, message: genpy.Message) -> None:
        """Give the process a message from outside; KeyError if it does not subscribe."""
        for receive in _named(self.subscribers, topic, "subscriber of"):
            receive(message)

    def published(self, topic: str) -> list[genpy.Message]:
        """Return all messages that left the process on a topic, oldest first."""
        return _named(self.publishers, topic, "publisher of").messages

    def call(self, service: str, request: genpy.Message) -> genpy.Message | Future[genpy.Message]:
        """Call a service from outside; `ServiceError` if it refuses.

        The response is a future if the service takes time.
        """
        answer = _named(self.services, service, "service")(request)
        return answer.result() if answer.done() else answer

    def remap(self, name: str) -> str:
        """Return the name in ``remappings``, or ``name``."""
        self.names.add(name)
        return self.remappings.get(name, name)

    def get_param(self, name: str) -> Any:
        """Return an entry of ``parameters``, or those below a namespace."""
        if name in self.parameters:
            return self.parameters[name]
        below = ParamDictionary(None)
        for key, value in self.parameters.items():
            if key.startswith(f"{name.rstrip('/')}/"):
                below.set_param(key, value)
        return below.get_param(name)

    def set_param(self, name: str, value: Any) -> None:
        """Set an entry of ``parameters``; a dictionary is a namespace, as with ROS."""
        if not isinstance(value, dict):
            self.parameters[name] = value
            return
        for key, item in value.items():
            self.set_param(f"{name}/{key}", item)

    def advertise(self, topic: str, message_type: type, latch: bool) -> ExternalPublisher:
        """Return a publisher that keeps the messages."""
        self.changes += 1
        self.publisher_types[topic] = message_type
        return self.publishers.setdefault(topic, _Publication(self, topic))

    def subscribe(
        self, topic: str, message_type: type, deliver: Receiver, may_wait: Condition = never
    ) -> ExternalSubscriber:
        """Keep the function to which `deliver` gives messages."""
        self.changes += 1
        self.subscriber_types[topic] = message_type
        self.subscribers.setdefault(topic, []).append(deliver)
        return _Subscription(self, topic, deliver)

    def is_published(self, topic: str) -> bool:
        """Return whether another process publishes a topic."""
        return topic not in self.unpublished

    def advertise_service(self, name: str, service_type: type, serve: Serve) -> Callable[[], None]:
        """Keep ``serve`` for `call`."""
        self.services[name] = lambda request: serve(request, never)
        self.service_types[name] = service_type

        def withdraw() -> None:
            del self.services[name], self.service_types[name]

        return withdraw

    def call_service(
        self, name: str, service_type: type, request: Any, limit: float, start_limit: float
    ) -> Future[Any]:
        """Call a service of this process; fail if it does not exist."""
        return self.find_service(name)(request)

    def find_service(self, name: str) -> Callable[[Any], Future[Any]]:
        """Return the function that serves calls of a service of this process."""
        return self.services.get(name, refuse(name))

    def service_nodes(self) -> dict[str, str]:
        """Return the services of this process."""
        return dict.fromkeys(self.services, "/this_process")

    def log(self, level: str, text: str) -> None:
        """Keep the record."""
        self.log_records.append((level, text))
        self.on_log(level, text)


def refuse(service: str) -> Callable[[Any], Future[Any]]:
    """Return the function that answers calls of a missing service."""
    refusal: Future[Any] = Future()
    refusal.set_exception(ServiceError(f"there is no service {service}"))
    return lambda request: refusal


def _named(things, name, kind):
    try:
        return things[name]
    except KeyError:
        raise KeyError(f"there is no {kind} {name}; known: {sorted(things)}") from None
