"""A whole graph without ROS: processes can be killed, frozen and restarted; manual time."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any

import genpy

from crazyflie_utils.journal.recording import Recorder
from crazyflie_utils.node import Node
from crazyflie_utils.offline_process import pass_time
from crazyflie_utils.offline_transport import refuse
from crazyflie_utils.steps import copy_outcome
from crazyflie_utils.testing.fake_process import FakeProcess
from crazyflie_utils.testing.fake_transport import FakeTransport
from crazyflie_utils.topics import Condition, ExternalPublisher, ExternalSubscriber, Receiver, never

#: Largest number of messages that wait for a frozen process on one connection; of later ones only
#: the last is kept.
_MAX_WAITING = 100


class FakeGraph:
    """Processes with a node each, and the connections between them.

    ``parameters`` are those of all processes, full name to raw value; ``start`` is the time at the
    beginning, s. ``recorder(process, time)`` returns the recorder of a process, if it is to have a
    journal.
    """

    def __init__(
        self,
        parameters: dict[str, object],
        start: float = 100.0,
        recorder: Callable[[str, float], Recorder | None] = lambda process, time: None,
    ):
        #: Present time (s). Faults of topics: ``fault(message)`` returns the messages that arrive
        #: in its place.
        self.time = start
        self.faults: dict[str, Callable[[Any], list[Any]]] = {}
        #: Pairs of process and topic whose messages do not reach this process.
        self.unheard: set[tuple[str, str]] = set()
        self.log: list[tuple[str, str]] = []  #: Level and text of what nodes have logged.
        self._recorder = recorder
        self._wall_offset = 0.0
        self._headers: dict[tuple[str, str], dict[str, str]] = {}
        self._parameters = parameters
        self._processes: dict[str, _GraphProcess] = {}
        self._listeners: dict[str, list[Receiver]] = {}
        # Those of the graph and of processes that have ended.
        self._changes = 0

    # The processes.

    def start(self, name: str, node: Node) -> None:
        """Start a process with one node; RuntimeError if the node could not be initialized."""
        recorder = self._recorder(name, self.time)
        process = _GraphProcess(name, self, self._parameters, node, recorder)
        self._processes[name] = process
        process.clock.wall_offset = self._wall_offset
        if not process.launch(node, name):
            raise RuntimeError(f"{name} was not initialized: {self.log[-1:]}")

    def kill(self, name: str) -> None:
        """Kill a process as SIGKILL does: it sends nothing more."""
        process = self._processes.pop(name)
        self._changes += process.transport.changes + 1
        if process.recorder is not None:
            process.recorder.close()

    def end_journals(self) -> None:
        """Write what the journals of all processes still lack."""
        for process in self._processes.values():
            if process.recorder is not None:
                process.recorder.close()

    def interrupt(self, name: str) -> None:
        """Ask a process to prepare its end, as SIGINT and ``rosnode kill`` do; it continues."""
        process = self._processes[name]
        process.prepare_shutdown({name: process.node})

    def end(self, name: str) -> None:
        """Shut a process down, as at the end of its flight."""
        process = self._processes[name]
        process.shut_down({name: process.node})
        self.kill(name)

    def freeze(self, name: str) -> None:
        """Stop a process as SIGSTOP does: messages and calls wait for it."""
        self._processes[name].is_frozen = True

    def thaw(self, name: str) -> None:
        """Resume a frozen process, with the messages and calls that have waited."""
        process = self._processes[name]
        process.is_frozen = False
        process.set_clocks(self.time)
        while process.waiting:
            deliver, message = process.waiting.pop(0)
            deliver(message)

    def is_alive(self, name: str) -> bool:
        """Return whether a process exists, frozen or not."""
        return name in self._processes

    # Outside of the processes.

    def stamp(self) -> genpy.Time:
        """Return the present ROS time."""
        return genpy.Time.from_sec(self.time + self._wall_offset)

    def step_wall_clock(self, step: float) -> None:
        """Step the wall clock of all processes forward, or back if ``step`` (s) is negative."""
        self._wall_offset += step
        for process in self._processes.values():
            process.clock.wall_offset = self._wall_offset

    def publish(self, topic: str, message: genpy.Message, caller: str = "") -> None:
        """Publish as a process, or as the node ``caller`` outside of them."""
        for listener in self._listeners.get(topic, ()):
            listener(message)
        # As in rospy, the messages of a connection share one.
        header = self._headers.setdefault((caller, topic), {"callerid": caller, "topic": topic})
        fault = self.faults.get(topic)
        for arriving in [message] if fault is None else fault(message):
            arriving._connection_header = header
            for name, process in list(self._processes.items()):
                if name != caller and (name, topic) not in self.unheard:
                    for deliver in tuple(process.transport.subscribers.get(topic, ())):
                        process.receive(deliver, arriving)

    def listen(self, topic: str, callback: Receiver) -> None:
        """Call ``callback(message)`` with each message published on a topic, without its faults."""
        self._listeners.setdefault(topic, []).append(callback)
        self._changes += 1

    def services(self) -> dict[str, type]:
        """Return the services of all processes that are alive, name -> type."""
        return {
            name: service_type
            for process in self._processes.values()
            for name, service_type in process.transport.service_types.items()
        }

    def find_service(self, service: str) -> Callable[[Any], Future[Any]]:
        """Return the function that serves calls of any service; calls to a frozen process wait."""
        for process in self._processes.values():
            serve = process.transport.services.get(service)
            if serve is not None:
                return partial(process.keep_call, serve) if process.is_frozen else serve
        return refuse(service)

    def call(self, service: str, request: genpy.Message) -> Future[Any]:
        """Call a service; the future may never be done when its process dies."""
        return self.find_service(service)(request)

    def advance(self, duration: float) -> None:
        """Advance the time (s), with a stop at every timer's deadline."""

        def next_deadline() -> float:
            awake = [each for each in self._processes.values() if not each.is_frozen]
            return min((each.next_deadline() for each in awake), default=math.inf)

        pass_time(duration, lambda: self.time, next_deadline, self._move_to)

    def _move_to(self, time):
        self.time = time
        for process in list(self._processes.values()):
            if not process.is_frozen and process.name in self._processes:
                process.set_clocks(time)

    # Data of the transports.

    def changes(self) -> int:
        """Return how often anybody has begun, or ended, to publish or to receive a topic."""
        processes = self._processes.values()
        return sum((each.transport.changes for each in processes), self._changes)

    def publishes(self, topic: str, excluding: str) -> bool:
        """Return whether another process than ``excluding`` publishes a topic."""
        return any(topic in each.advertised for each in self._others(excluding))

    def subscribes(self, topic: str, excluding: str) -> bool:
        """Return whether anyone but ``excluding`` receives a topic."""
        others = self._others(excluding)
        return topic in self._listeners or any(each.subscribers.get(topic) for each in others)

    def latched(self, topic: str, excluding: str) -> list[Any]:
        """Return messages that processes other than ``excluding`` have latched on a topic."""
        others = self._others(excluding)
        return [each.latched[topic] for each in others if topic in each.latched]

    def _others(self, name):
        return [each.transport for each in self._processes.values() if each.name != name]


class _GraphProcess(FakeProcess):
    """One process of the graph."""

    transport: _GraphTransport

    def __init__(
        self,
        name: str,
        graph: FakeGraph,
        parameters: dict[str, object],
        node: Node,
        recorder: Recorder | None,
    ):
        transport = _GraphTransport(name, graph, parameters)
        super().__init__(transport=transport, start=graph.time, recorder=recorder)
        self.name = name
        self.node = node
        self.is_frozen = False
        self.waiting: list[tuple[Receiver, Any]] = []

    def keep_call(self, serve: Callable[[Any], Future[Any]], request: Any) -> Future[Any]:
        """Serve a call once the process continues, unless its future is cancelled before."""
        answer: Future[Any] = Future()

        def begin(request):
            if not answer.cancelled():
                serve(request).add_done_callback(lambda served: copy_outcome(served, answer))

        self.waiting.append((begin, request))
        return answer

    def receive(self, deliver: Receiver, message: Any) -> None:
        """Deliver a message, or keep it until the process continues."""
        if self.is_frozen:
            same = [k for k, (other, _) in enumerate(self.waiting) if other is deliver]
            if len(same) == _MAX_WAITING:
                del self.waiting[same[0]]
            self.waiting.append((deliver, message))
            return
        # The order of processes that wake up at one moment is random.
        if self.clock.time() != self.transport.graph.time:
            self.set_clocks(self.transport.graph.time)
        deliver(message)


class _Publication(ExternalPublisher):
    def __init__(self, transport: _GraphTransport, topic: str, latch: bool):
        self._transport = transport
        self._topic = topic
        self._latch = latch

    def has_subscribers(self) -> bool:
        return self._transport.graph.subscribes(self._topic, self._transport.name)

    def publish(self, *messages: genpy.Message) -> bytes | None:
        for message in messages:
            if self._latch:
                self._transport.latched[self._topic] = message
            self._transport.graph.publish(self._topic, message, self._transport.name)
        return None

    def close(self) -> None:
        self._transport.advertised.remove(self._topic)
        self._transport.changes += 1


class _GraphTransport(FakeTransport):
    """The outside world of one process: the other processes."""

    def __init__(self, name: str, graph: FakeGraph, parameters: dict[str, object]):
        super().__init__(parameters)
        # All processes have one parameter server.
        self.parameters = parameters
        self.name = name
        self.graph = graph
        self.advertised: list[str] = []
        self.latched: dict[str, Any] = {}  #: Message that is latched on each topic.

    def advertise(self, topic: str, message_type: type, latch: bool) -> ExternalPublisher:
        self.changes += 1
        self.advertised.append(topic)
        return _Publication(self, topic, latch)

    def subscribe(
        self, topic: str, message_type: type, deliver: Receiver, may_wait: Condition = never
    ) -> ExternalSubscriber:
        subscription = super().subscribe(topic, message_type, deliver)
        for message in self.graph.latched(topic, self.name):
            deliver(message)
        return subscription

    def peer_changes(self) -> int:
        return self.graph.changes()

    def is_published(self, topic: str) -> bool:
        return self.graph.publishes(topic, self.name)

    def find_service(self, name: str) -> Callable[[Any], Future[Any]]:
        return self.graph.find_service(name)

    def log(self, level: str, text: str) -> None:
        super().log(level, text)
        self.graph.log.append((level, text))
