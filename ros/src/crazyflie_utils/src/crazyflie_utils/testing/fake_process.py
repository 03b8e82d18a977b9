"""A process without ROS, for unit tests: parameters in a dict, time by hand."""

import io
import math
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import genpy
from dynamic_reconfigure.encoding import encode_config
from dynamic_reconfigure.srv import ReconfigureRequest
from typing_extensions import override

from crazyflie_utils.clock import SimulatedClock
from crazyflie_utils.node import Node
from crazyflie_utils.process import Process
from crazyflie_utils.timers import Timer
from crazyflie_utils.transport import ExternalPublisher, ExternalSubscriber, ServiceError, Transport


class _Record(ExternalPublisher):
    def __init__(self) -> None:
        self.messages: list[genpy.Message] = []

    def has_subscribers(self) -> bool:
        return True

    def publish(self, *messages: genpy.Message) -> None:
        for message in messages:
            # What cannot be sent must fail here as it would on a wire.
            message.serialize(io.BytesIO())
            self.messages.append(message)

    def close(self) -> None:
        pass


class FakeSubscriber(ExternalSubscriber):
    """A subscription that asks and closes by functions."""

    def __init__(self, is_published: Callable[[], bool], close: Callable[[], None]):
        self._is_published = is_published
        self._close = close

    @override
    def has_publishers(self) -> bool:
        return self._is_published()

    @override
    def close(self) -> None:
        self._close()


class FakeTransport(Transport):
    """An outside world that remembers everything and does nothing by itself.

    Every topic that is subscribed has publishers there, but for those in ``unpublished``.
    ``foreign_services`` are those of other processes, name -> node.
    """

    def __init__(self, parameters: dict[str, object]):
        self.parameters = dict(parameters)
        self.publishers: dict[str, _Record] = {}
        self.subscribers: dict[str, list[Callable[[Any], None]]] = {}
        self.unpublished: set[str] = set()
        self.services: dict[str, Callable[[Any], Future[Any]]] = {}
        self.service_types: dict[str, type] = {}
        self.foreign_services: dict[str, str] = {}
        self.log_records: list[tuple[str, str]] = []

    def remap(self, name: str) -> str:
        """Return ``name``: nothing is remapped."""
        return name

    def get_param(self, name: str) -> Any:
        """Return an entry of ``parameters``, or those below a namespace."""
        if name in self.parameters:
            return self.parameters[name]
        below = {
            key.removeprefix(f"{name}/"): value
            for key, value in self.parameters.items()
            if key.startswith(f"{name}/")
        }
        if not below:
            raise KeyError(name)
        return _tree(below)

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
        self, topic: str, message_type: type, deliver: Callable[[Any], None]
    ) -> ExternalSubscriber:
        """Keep ``deliver`` for `FakeProcess.publish`."""
        subscribers = self.subscribers.setdefault(topic, [])
        subscribers.append(deliver)
        return FakeSubscriber(
            lambda: topic not in self.unpublished, lambda: subscribers.remove(deliver)
        )

    def advertise_service(
        self,
        name: str,
        service_type: type,
        serve: Callable[[Any], Future[Any]],
        time: Callable[[], float],
    ) -> Callable[[], None]:
        """Keep ``serve`` for `FakeProcess.call`."""
        self.services[name] = serve
        self.service_types[name] = service_type

        def withdraw() -> None:
            del self.services[name], self.service_types[name]

        return withdraw

    def call_service(
        self, name: str, service_type: type, request: Any, limit: float
    ) -> Future[Any]:
        """Call a service of this process; fail when there is none."""
        if name in self.services:
            return self.services[name](request)
        future: Future[Any] = Future()
        future.set_exception(ServiceError(f"there is no service {name}"))
        return future

    def service_nodes(self) -> dict[str, str]:
        """Return the services of this process and ``foreign_services``."""
        return dict.fromkeys(self.services, "/this_process") | self.foreign_services

    def log(self, level: str, text: str) -> None:
        """Keep the record."""
        self.log_records.append((level, text))

    def clock_was_set(self, stamp: genpy.Time) -> None:
        """Do nothing."""


class FakeProcess(Process):
    """A process for tests: the real node handle, executor, timers and tf buffer.

    The parameters are full name to raw value, such as {"/simulator/time_step": 0.01}; a
    ``transport`` takes the place of one with them. ``start`` is the simulated time at the
    beginning, s.
    """

    transport: FakeTransport
    clock: SimulatedClock

    def __init__(
        self,
        parameters: dict[str, object] | None = None,
        start: float = 100.0,
        transport: FakeTransport | None = None,
    ):
        super().__init__(transport or FakeTransport(parameters or {}), use_sim_time=True)
        self.clock.set(start)
        self.executor.start()

    def launch(self, node: Node, name: str, parameters: dict[str, object] | None = None) -> bool:
        """Initialize a node with private parameters; return what ``node.initialize`` returned."""
        for key, value in (parameters or {}).items():
            self.transport.parameters[f"{name}/{key}"] = value
        outcome: list[bool] = []
        # As work: a latched message must wait until the node is complete.
        self.executor.submit(lambda: outcome.append(node.initialize(self.handle(name))))
        return outcome[0]

    def add_timer(
        self,
        period: float,
        work: Callable[[], None],
        steady: bool = False,
        stagger: bool = False,
        align_phase: bool = False,
    ) -> Timer:
        """Add a timer; the machine's time, too, is moved by hand here."""
        return super().add_timer(period, work, stagger=stagger, align_phase=align_phase)

    def publish(self, topic: str, message: genpy.Message) -> None:
        """Publish from outside the process."""
        for deliver in _named(self.transport.subscribers, topic, "subscriber of"):
            deliver(message)

    def published(self, topic: str) -> list[genpy.Message]:
        """Return all messages that left the process on a topic, oldest first."""
        return _named(self.transport.publishers, topic, "publisher of").messages

    def call(self, service: str, request: genpy.Message) -> genpy.Message | Future[genpy.Message]:
        """Call a service from outside; `ServiceError` if it refuses.

        The response is a future when the service takes time: let it pass with `advance`.
        """
        answer = _named(self.transport.services, service, "service")(request)
        return answer.result() if answer.done() else answer

    def reconfigure(self, node: str, **values: object) -> genpy.Message | Future[genpy.Message]:
        """Change parameters of a node as dynamic_reconfigure does; see `call`."""
        return self.call(f"{node}/set_parameters", ReconfigureRequest(encode_config(values)))

    def logged(self, level: str) -> list[str]:
        """Return the texts logged at a level, oldest first."""
        return [text for logged_at, text in self.transport.log_records if logged_at == level]

    def advance(self, duration: float) -> None:
        """Let time pass (s), stopping at every timer's deadline."""
        end = self.clock.time() + duration
        while True:
            deadline = self.next_simulated_deadline()
            if math.isinf(deadline) or deadline > end + 1e-9:
                break
            self.clock.set(max(deadline, self.clock.time()))
        # A deadline may be past the end by a rounding error: no step back then.
        self.clock.set(max(end, self.clock.time()))


def _tree(leaves):
    tree: dict[str, Any] = {}
    for name, value in leaves.items():
        *folders, leaf = name.split("/")
        branch = tree
        for folder in folders:
            branch = branch.setdefault(folder, {})
        branch[leaf] = value
    return tree


def _named(things, name, kind):
    try:
        return things[name]
    except KeyError:
        raise KeyError(f"there is no {kind} {name}; known: {sorted(things)}") from None
