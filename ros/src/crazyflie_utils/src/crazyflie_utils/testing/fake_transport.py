"""The world outside a process, for unit tests."""

import io
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from typing import Any

import genpy
from rosmaster.paramserver import ParamDictionary

from crazyflie_utils.journal.recording import copy_outcome
from crazyflie_utils.refusal import ServiceError
from crazyflie_utils.timers import TimerQueue
from crazyflie_utils.topics import (
    Condition,
    ExternalPublisher,
    ExternalSubscriber,
    Receiver,
    Serve,
    Transport,
    never,
)


class _Record(ExternalPublisher):
    def __init__(self) -> None:
        self.messages: list[genpy.Message] = []

    def has_subscribers(self) -> bool:
        return True

    def publish(self, *messages: genpy.Message) -> None:
        for message in messages:
            # A message that cannot be serialized must fail here as it would on a wire.
            message.serialize(io.BytesIO())
            self.messages.append(message)

    def close(self) -> None:
        pass


class _Subscription(ExternalSubscriber):
    def __init__(self, transport: "FakeTransport", topic: str, deliver: Receiver):
        self._transport = transport
        self._topic = topic
        self._deliver = deliver

    def has_publishers(self) -> bool:
        return self._transport.is_published(self._topic)

    def close(self) -> None:
        self._transport.subscribers[self._topic].remove(self._deliver)


class FakeTransport(Transport):
    """An outside world that records everything and does nothing by itself.

    Every subscribed topic has publishers there, except those in ``unpublished``.
    ``foreign_services`` are those of other processes, name -> node; ``dead_nodes`` do not answer.
    """

    machine_timers: TimerQueue  #: They limit the duration of service calls; set by `FakeProcess`.

    def __init__(self, parameters: dict[str, object]):
        self.parameters = dict(parameters)
        self.publishers: dict[str, _Record] = {}
        self.subscribers: dict[str, list[Receiver]] = {}
        self.unpublished: set[str] = set()
        self.services: dict[str, Callable[[Any], Future[Any]]] = {}
        self.service_types: dict[str, type] = {}
        self.foreign_services: dict[str, str] = {}
        self.dead_nodes: set[str] = set()
        self.log_records: list[tuple[str, str]] = []

    def remap(self, name: str) -> str:
        """Return ``name``: nothing is remapped."""
        return name

    def get_param(self, name: str) -> Any:
        """Return an entry of ``parameters``, or those below a namespace."""
        if name in self.parameters:
            return self.parameters[name]
        below = ParamDictionary(None)
        for key, value in self.parameters.items():
            if key.startswith(f"{name}/"):
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
        return self.publishers.setdefault(topic, _Record())

    def subscribe(
        self, topic: str, message_type: type, deliver: Receiver, may_wait: Condition = never
    ) -> ExternalSubscriber:
        """Keep ``deliver`` for `FakeProcess.publish`."""
        self.subscribers.setdefault(topic, []).append(deliver)
        return _Subscription(self, topic, deliver)

    def is_published(self, topic: str) -> bool:
        """Return whether another process publishes a topic."""
        return topic not in self.unpublished

    def advertise_service(self, name: str, service_type: type, serve: Serve) -> Callable[[], None]:
        """Keep ``serve`` for `FakeProcess.call`."""
        self.services[name] = lambda request: serve(request, never)
        self.service_types[name] = service_type

        def withdraw() -> None:
            del self.services[name], self.service_types[name]

        return withdraw

    def call_service(
        self, name: str, service_type: type, request: Any, limit: float, start_limit: float
    ) -> Future[Any]:
        """Call a service; fail if it does not exist, or does not answer in time."""
        answer = self.find_service(name)(request)
        if answer.done():
            return answer
        reply: Future[Any] = Future()

        def give_up() -> None:
            answer.cancel()
            with suppress(InvalidStateError):
                reply.set_exception(ServiceError(f"{name} has not answered within {limit:g} s"))

        timer = self.machine_timers.add(limit, give_up)
        reply.add_done_callback(lambda _: timer.stop())
        answer.add_done_callback(lambda _: copy_outcome(answer, reply))
        return reply

    def find_service(self, name: str) -> Callable[[Any], Future[Any]]:
        """Return the function that serves calls of a service of this process."""
        return self.services.get(name, refuse(name))

    def service_nodes(self) -> dict[str, str]:
        """Return the services of this process and ``foreign_services``."""
        return dict.fromkeys(self.services, "/this_process") | self.foreign_services

    def living_node(self, name: str) -> str | None:
        """Return a process for nodes of ``foreign_services``, except ``dead_nodes``."""
        lives = name in self.foreign_services.values() and name not in self.dead_nodes
        return "process 1 on elsewhere" if lives else None

    def log(self, level: str, text: str) -> None:
        """Keep the record; pytest shows errors below a test that fails."""
        self.log_records.append((level, text))
        if level in ("error", "fatal"):
            print(f"[{level.upper()}] {text}")

    def clock_was_set(self, stamp: genpy.Time) -> None:
        """Do nothing."""


def refuse(service: str) -> Callable[[Any], Future[Any]]:
    """Return the function that answers calls of a missing service."""
    refusal: Future[Any] = Future()
    refusal.set_exception(ServiceError(f"there is no service {service}"))
    return lambda request: refusal
