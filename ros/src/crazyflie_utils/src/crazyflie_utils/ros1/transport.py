"""The interface of a process to other processes, by rospy."""

import contextlib
import math
import resource
import threading
from collections import Counter
from collections.abc import Callable, Hashable, Iterator
from concurrent.futures import Future
from functools import partial
from queue import SimpleQueue
from typing import Any

import genpy
import rosgraph
import rospy
from rosgraph_msgs.msg import Clock

from crazyflie_utils.context import Throttle
from crazyflie_utils.parameters.server import ParameterWriter
from crazyflie_utils.refusal import ServiceError
from crazyflie_utils.ros1 import patches
from crazyflie_utils.ros1.calls import (
    OwnService,
    ServiceCaller,
    WithdrawableService,
    wait_for_answer,
    withdrawn,
)
from crazyflie_utils.ros1.master_watch import living_node
from crazyflie_utils.ros1.own_topics import OwnCallback, OwnPublication, PeerChanges
from crazyflie_utils.ros1.patches import log_without_master, shield_screen_log
from crazyflie_utils.ros1.receiving import collect_waiting
from crazyflie_utils.topics import (
    Condition,
    ExternalPublisher,
    ExternalSubscriber,
    Receiver,
    Serve,
    Transport,
    never,
)

#: Number of messages kept for a subscriber that does not keep up: a simulation that runs as fast as
#: possible fills a short queue before the subscriber runs.
_QUEUE_SIZE = 100


class _RosPublisher(ExternalPublisher):
    def __init__(
        self,
        publisher: rospy.Publisher,
        on_close: Callable[[], None],
        outside: Callable[..., None],
    ):
        self._publisher = publisher
        self._on_close, self._outside = on_close, outside

    def has_subscribers(self) -> bool:
        implementation = self._publisher.impl
        return implementation is not None and bool(implementation.connections)

    def publish(self, *messages: genpy.Message) -> bytes | None:
        own = self._publisher.impl
        if isinstance(own, OwnPublication) and not own.closed:
            return own.send(messages)
        for message in messages:
            self._publisher.publish(message)
        return None

    def close(self) -> None:
        self._on_close()
        self._outside(self._publisher.unregister)


class _RosSubscriber(ExternalSubscriber):
    """The subscriber of ``register()``; ``run(work)`` does work that waits for the master."""

    def __init__(
        self, register: Callable[[], rospy.Subscriber], run: Callable[[Callable[[], None]], None]
    ):
        self._register, self._run = register, run
        self._subscriber: rospy.Subscriber | None = None
        run(self._begin)

    def _begin(self):
        self._subscriber = self._register()

    def has_publishers(self) -> bool:
        return self._subscriber is not None and self._subscriber.get_num_connections() > 0

    def close(self) -> None:
        self._run(lambda: self._subscriber and self._subscriber.unregister())


class RosTransport(Transport):
    """rospy, for a process that has called ``rospy.init_node``.

    If ``limits_rate``, it decodes floods in part, and messages may wait in their sockets; not in
    simulated time, which may pass so quickly that the sockets would be full of old messages.
    ``refused`` has the numbers of peers' errors, by kind.
    """

    def __init__(self, limits_rate: bool = True) -> None:
        self.refused: Counter[Hashable] = Counter()
        self._complaints = Throttle()
        self._limits_rate = limits_rate
        shield_screen_log()
        log_without_master()
        patches.harden_tcp_server(self._refuse)
        allow_many_topics()
        self._remappings = dict(rospy.names.get_resolved_mappings())
        self._before_remapping = {name: first for first, name in self._remappings.items()}
        self._published: Counter[str] = Counter()
        self._sets_clock = False
        self._caller = ServiceCaller()
        self._parameter_writer = ParameterWriter(
            # A new connection: other threads use rospy's own connection to the master.
            lambda name, value: rosgraph.Master(rospy.get_name()).setParam(name, value),
            partial(self.log, "warn"),
        )
        self._for_master: SimpleQueue[Callable[[], None]] | None = None
        self._services_at_start: dict[str, str] = {}
        self._is_starting = False

    def follow_clock(self) -> None:
        """Set rospy's clock by /clock, as this transport receives or publishes it."""
        self._sets_clock = patches.take_over_clock()
        if self._sets_clock:
            self.subscribe("/clock", Clock, lambda message: patches.set_clock(message.clock))

    @contextlib.contextmanager
    def starting(self) -> Iterator[None]:
        """Register with the master in one request, and ask it for others' services once."""
        self._is_starting, self._services_at_start = True, {}
        try:
            with patches.registering_together():
                yield
        finally:
            self._is_starting = False

    def _refuse(self, text, key):
        # Reported once, since a faulty peer stays faulty; and for the first 64 peers only.
        if self._complaints.passes(key, math.inf, 0.0):
            self.log("warn", text)
        elif key not in self.refused:
            key = "others"
        self.refused[key] += 1

    def remap(self, name: str) -> str:
        """Return the name to which the command line remaps a name."""
        return self._remappings.get(name, name)

    def _rospy_name(self, name):
        """Return the name that rospy remaps to ``name``, which it must not remap once more."""
        return self._before_remapping[name] if name in self._remappings else name

    def get_param(self, name: str) -> Any:
        """Return a parameter from the parameter server."""
        return self.outside(rospy.get_param, self._rospy_name(name))

    def set_param(self, name: str, value: Any) -> None:
        """Set a parameter on the parameter server."""
        self.outside(rospy.set_param, self._rospy_name(name), value)

    def set_param_later(self, name: str, value: Any) -> "Future[None]":
        """Set a parameter on the parameter server by a thread that may wait for it."""
        return self._parameter_writer.set(name, value)

    def advertise(self, topic: str, message_type: type, latch: bool) -> ExternalPublisher:
        """Register a publisher with the master."""
        self._published[topic] += 1
        patches.own_publication(topic, message_type, _QUEUE_SIZE, latch)
        register = partial(rospy.Publisher, latch=latch, queue_size=_QUEUE_SIZE)
        publisher = self.outside(register, self._rospy_name(topic), message_type)
        return _RosPublisher(
            publisher, lambda: self._published.subtract([topic]), lambda *call: self.outside(*call)
        )

    def subscribe(
        self, topic: str, message_type: type, deliver: Receiver, may_wait: Condition = never
    ) -> ExternalSubscriber:
        """Register a subscriber with the master, from a callback without waiting for it."""

        def is_handed_over():
            return self._published[topic] > 0

        def register():
            report, limits_rate = self._refuse, self._limits_rate
            patches.own_subscription(topic, message_type, is_handed_over, report, limits_rate)
            callback = OwnCallback(deliver, is_handed_over, lambda: limits_rate and may_wait())
            name = self._rospy_name(topic)
            return rospy.Subscriber(name, message_type, callback, tcp_nodelay=True)

        return _RosSubscriber(register, self._run)

    def peer_changes(self) -> int:
        """Count those of the topics of this process."""
        return PeerChanges.count

    def collect(self) -> None:
        """Read the sockets in which messages wait."""
        collect_waiting()

    def _run(self, work):
        """Do work that waits for the master: in order, from callbacks in a thread."""
        if self._for_master is None:
            if not self.is_in_callback():
                work()
                return
            self._for_master = SimpleQueue()
            threading.Thread(target=self._run_queued, args=(self._for_master,), daemon=True).start()
        self._for_master.put(work)

    def _run_queued(self, queue):
        while True:
            work = queue.get()
            try:
                work()
            except Exception as error:
                self.log("error", f"a subscription has failed: {error!r}")

    def advertise_service(self, name: str, service_type: type, serve: Serve) -> Callable[[], None]:
        """Register a service; `ServiceError` if this process offers one of that name already."""

        def answer(request):
            try:
                return wait_for_answer(serve(request, withdrawn()), name, self.time)
            except ServiceError as error:
                raise rospy.ServiceException(str(error)) from None

        try:
            service = self.outside(
                WithdrawableService, self._rospy_name(name), service_type, answer
            )
        except rospy.ServiceException as error:
            raise ServiceError(str(error)) from None
        self._caller.own[name] = OwnService(service, serve)

        def end():
            del self._caller.own[name]
            self.outside(service.shutdown, "no longer offered")

        return end

    def call_service(
        self, name: str, service_type: type, request: Any, limit: float, start_limit: float
    ) -> Future[Any]:
        """Call in a thread of its own; see `ServiceCaller.call`."""
        return self._caller.call(
            name, self._rospy_name(name), service_type, request, limit, start_limit
        )

    def service_nodes(self) -> dict[str, str]:
        """Ask the master."""
        if not (self._is_starting and self._services_at_start):
            master = rosgraph.Master(rospy.get_name())
            _, _, services = self.outside(master.getSystemState)
            self._services_at_start = {name: nodes[0] for name, nodes in services}
        return self._services_at_start

    def living_node(self, name: str) -> str | None:
        """Ask the master for the node, and the node itself."""
        is_own = name == rospy.get_name()
        return self.outside(lambda: None if is_own else living_node(name))

    def log(self, level: str, text: str) -> None:
        """Log to the screen, the node's log file and /rosout."""
        _LOGGERS[level](text)

    def clock_was_set(self, stamp: genpy.Time) -> None:
        """Set rospy's own clock, which stamps the log."""
        if self._sets_clock:
            patches.set_clock(stamp)


def allow_many_topics() -> None:
    """Raise this process's limit of open files to the largest that the system allows.

    rospy holds one for each topic, and a shell allows 1024 unless told otherwise: too few for
    forty vehicles.
    """
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    # If the system refuses, a process with few topics does not need it.
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


_LOGGERS = {
    "debug": rospy.logdebug,
    "info": rospy.loginfo,
    "warn": rospy.logwarn,
    "error": rospy.logerr,
    "fatal": rospy.logfatal,
}
