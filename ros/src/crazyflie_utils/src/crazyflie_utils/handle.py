"""The interface of a node to ROS: roscpp's NodeHandle for Python."""

import contextlib
import math
import traceback
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any, TypeVar

import genpy
import rosgraph.names
from std_srvs.srv import Trigger, TriggerResponse
from typing_extensions import override

from crazyflie_utils.context import FaultHandler, NodeLog, ProcessContext
from crazyflie_utils.parameters.declaration import (
    REQUIRED,
    Declaration,
    ParameterError,
    Parameters,
    read_parameter,
)
from crazyflie_utils.parameters.server import PrivateParameters, Reconfiguration
from crazyflie_utils.parameters.types import ParameterType
from crazyflie_utils.refusal import RefusalError, ServiceError
from crazyflie_utils.tf.frame_tree import StampedPose
from crazyflie_utils.timers import Timer
from crazyflie_utils.topics import LatestMessage, Publisher, Subscriber
from crazyflie_utils.vectors import is_finite, number_getter

P = TypeVar("P", bound=Parameters)
M = TypeVar("M", bound=genpy.Message)


class NodeHandle:
    """Names, parameters, topics, services, timers, time, tf and log of one node.

    Callbacks run one at a time, also those of several nodes in a process. One that raises is logged
    once with its traceback, `on_fault` puts the node into its safe state, and the callback will be
    called again. ``name`` is the node's absolute name, such as /simulator.
    """

    def __init__(self, process: ProcessContext, name: str):
        self.name = name
        self.is_closed = False  #: Whether `close` was called.
        self._process = process
        self._submit = process.executor.submit
        self._undo: list[Callable[[], None]] = []
        self._latest: list[LatestMessage] = []
        self._own_parameters: PrivateParameters | None = None
        log = NodeLog(process.transport, name, process.machine_time)
        self.info, self.warn, self.error = log.info, log.warn, log.error  #: See `NodeLog`.
        self._faults = FaultHandler(log)
        self.report_fault = self._faults.report  #: See `FaultHandler.report`.
        clock = process.clock
        #: Seconds for intervals, ROS time for headers; see `SteadyClock` and `SimulatedClock`.
        self.time, self.stamp, self.nanoseconds = clock.time, clock.stamp, clock.nanoseconds
        #: For the node that publishes /clock; see `ProcessContext`.
        self.clock_publisher, self.next_event = process.clock_publisher, process.next_event
        tf = process.transforms
        self.broadcast_transforms = tf.broadcaster  #: Methods of `Transforms`, like the next five.
        self.broadcast_static_transforms = tf.static_broadcaster
        self.listen_to_transforms, self.listen_to_poses = tf.listener, tf.pose_listener
        self.has_pose_consumers = tf.has_pose_consumers
        self.rejected_transforms = tf.rejected_by_reason
        #: See `Transport.service_nodes`, which waits for the master.
        self.service_nodes = process.transport.service_nodes
        self.value = process.value  #: See `ProcessContext.value`.

    def child(self) -> "NodeHandle":
        """Return another handle of the node, to be closed before it; from any thread."""
        child = NodeHandle(self._process, self.name)
        child._faults, child.report_fault = self._faults, self.report_fault
        return child

    def close(self) -> None:
        """End everything that was created through this handle; its callbacks no longer run."""
        self.is_closed = True
        while self._undo:
            self._undo.pop()()

    def end(self, status: int = 0) -> None:
        """End the process, and with it all its nodes, with an exit status."""
        self._process.end(status)

    def resolve(self, name: str) -> str:
        """Return an absolute name, remapped; ``~name`` is the node's own."""
        return self._process.transport.remap(rosgraph.names.resolve_name(name, self.name))

    def load(self, parameters: type[P], on_change: Callable[[P], None] | None = None) -> P:
        """Return the node's own (private) parameters; `ParameterError` lists all errors.

        With ``on_change``, dynamic_reconfigure can change live ones, if any: after a change the
        function is called with all parameters, checked. It may raise `ParameterError` to refuse the
        change.
        """
        source = PrivateParameters(self._process.transport.get_param, self.name, self.resolve)
        loaded = parameters.read(source.get, source.full_name)
        self._process.known_parameters |= source.asked_for
        self._own_parameters = source
        if on_change is not None and any(each.live for each in parameters.declarations()):
            Reconfiguration(self, loaded, source.get, on_change)
        return loaded

    def warn_unknown_parameters(self) -> None:
        """Warn of the node's own parameters that no node of the process has declared or read."""
        source = self._own_parameters
        if source and (words := source.unknown(self._process.known_parameters)):
            self.warn(f"parameters that no node reads, and which have no effect: {words}")

    def get_param(self, name: str, type: ParameterType, default: Any = REQUIRED) -> Any:  # noqa: A002
        """Return a parameter that cannot be declared: another node's, or with a varying name.

        Blocks on the master; do not call it in a callback. Raises `ParameterError`, see `load`.
        """
        declaration = Declaration(self.resolve(name), type, "", default, live=False)
        self._process.known_parameters.add(declaration.name)
        return read_parameter(declaration, self._process.transport.get_param)

    def set_param(self, name: str, value: Any) -> None:
        """Set a parameter, or a namespace to a dictionary; waits for the master."""
        self._process.known_parameters.add(self.resolve(name))
        self._process.transport.set_param(self.resolve(name), value)

    def set_param_later(self, name: str, value: Any) -> "Future[None]":
        """As `set_param`, without waiting; the latest value is set. Any thread ends the future."""
        return self._process.transport.set_param_later(self.resolve(name), value)

    def publisher(self, topic: str, message_type: type, latch: bool = False) -> Publisher:
        """Announce a topic; with ``latch``, later subscribers are sent the last message."""
        publisher = self._process.topics.publisher(self.resolve(topic), message_type, latch)
        self._undo.append(publisher.close)
        return publisher

    def subscribe(
        self,
        topic: str,
        message_type: type[M],
        callback: Callable[[M], None],
        finite: str = "",
        on_invalid: Callable[[], None] | None = None,
        latest_only: bool = False,
    ) -> Subscriber:
        """Call ``callback(message)`` for each message, which is shared: never change it.

        ``finite`` is a field of the message, such as "control", whose numbers must be finite: other
        messages are dropped with a warning, and ``on_invalid()`` is called instead. With
        ``latest_only`` only the latest message is delivered, before the node's next timer or
        service call.
        """
        name = self.resolve(topic)
        numbers = number_getter(message_type, finite) if finite else None

        # One function, not one around another: it is called for each message.
        def work(message):
            if self.is_closed:
                return
            try:
                # If the sum is finite, so are the numbers; if it is not, it may have overflowed.
                if (
                    not finite
                    or (numbers and math.isfinite(sum(numbers(message))))
                    or is_finite(getattr(message, finite))
                ):
                    callback(message)
                    return
                self.warn(f"ignoring a message on {name}: its {finite} is not finite", throttle=1.0)
                if on_invalid is not None:
                    on_invalid()
            except Exception as error:
                self.report_fault(callback, error)

        topics = self._process.topics
        if latest_only:
            latest = LatestMessage(topics, name, message_type, work)
            subscriber = latest.subscriber
            self._latest.append(latest)
        else:
            subscriber = topics.subscribe(name, message_type, partial(self._submit, work))
        self._undo.append(subscriber.close)
        return subscriber

    def advertise_service(
        self, name: str, service_type: Any, callback: Callable[[Any], Any]
    ) -> None:
        """Answer calls of a service.

        ``callback(request)`` returns the response, or None for one without data; or, for work that
        takes time, a `concurrent.futures.Future` of it; or raises `ServiceError` or `RefusalError`
        with a text for the caller.
        """
        full_name, response_type = self.resolve(name), service_type._response_class
        empty = None if response_type.__slots__ else response_type()

        def serve(request, is_withdrawn, answer):
            for latest in self._latest:
                latest.deliver()
            if self.is_closed:
                return self._refuse(answer, ServiceError(f"{self.name} has ended this service"))
            if is_withdrawn():
                self.warn(f"{full_name}: the caller has cancelled this call; it is not carried out")
                return self._refuse(answer, ServiceError(f"{full_name}: the call was withdrawn"))
            try:
                response = callback(request)
            except Exception as error:
                if not isinstance(error, (ServiceError, RefusalError)):
                    self.report_fault(callback, error)
                return self._refuse(answer, error)
            if isinstance(response, Future):
                return response.add_done_callback(lambda done: self._forward(done, answer, empty))
            return answer.set_result(empty if response is None else response)

        def begin(request, is_withdrawn):
            # From outside; a node of this process may call the service in a callback.
            if not self._process.executor.is_in_turn:
                self._process.transport.collect()
            answer: Future[Any] = Future()
            self._submit(serve, request, is_withdrawn, answer)
            return answer

        advertise = self._process.transport.advertise_service
        self._undo.append(advertise(full_name, service_type, begin))

    def _refuse(self, answer, error):
        is_refusal = isinstance(error, (ServiceError, RefusalError))
        answer.set_exception(ServiceError(str(error) if is_refusal else f"{self.name}: {error!r}"))

    def _forward(self, done, to, empty=None):
        """Complete a future with the outcome of another, any error as a `ServiceError`."""
        if not to.set_running_or_notify_cancel():
            return
        if done.cancelled():
            self._refuse(to, ServiceError(f"{self.name}: cancelled"))
        elif (error := done.exception()) is None:
            to.set_result(empty if done.result() is None else done.result())
        else:
            if not isinstance(error, (ServiceError, RefusalError)):
                self.error(f"a service failed\n{''.join(traceback.format_exception(error))}")
            self._refuse(to, error)

    def claim_controls(self, topic: str, kind: str) -> None:
        """Claim a topic's controls for this node's vehicle, which is "simulated" or "real".

        ``ParameterError`` while a node of another process has claimed it and lives: controls of a
        simulation never reach a real vehicle. The claim is a service, ``TOPIC/vehicle``, whose
        response names the node.
        """
        name = f"{self.resolve(topic)}/vehicle"
        owner = self.service_nodes().get(name)
        place = None if owner is None else self._process.transport.living_node(owner)
        if place is not None:
            self._process.is_refused = True
            raise ParameterError(
                f"{self.name}: the controls of {self.resolve(topic)} already fly a vehicle of "
                f"{owner} ({place}, see {name}); end its launch first, or give this vehicle "
                "topics of its own"
            )
        answer = TriggerResponse(True, f"a {kind} vehicle, by {self.name}")
        # A second vehicle in this process has its own topics, or shares them on purpose.
        with contextlib.suppress(ServiceError):
            self.advertise_service(name, Trigger, lambda _: answer)

    def call_service(
        self,
        name: str,
        service_type: type,
        request: Any,
        limit: float,
        start_limit: float = math.inf,
    ) -> Future[Any]:
        """Call a service of any process, and return a future of the response at once.

        Its exception is a `ServiceError` when the service refuses, is not there, is not reached
        within ``start_limit`` seconds of the machine's clock, or does not answer within ``limit``
        seconds. The call is withdrawn then: a process that was stopped does not carry it out when
        it goes on. Functions that are added with ``add_done_callback`` run like any callback; no
        callback may wait for the future.
        """
        transport, outcome = self._process.transport, _Reply(self)
        reply = transport.call_service(
            self.resolve(name), service_type, request, limit, start_limit
        )
        reply.add_done_callback(lambda reply: self._submit(self._forward, reply, outcome))
        return outcome

    @property
    def uses_sim_time(self) -> bool:
        """Whether the process lives by simulated time (/use_sim_time)."""
        return self._process.uses_sim_time

    def age(self, stamp: genpy.Time) -> float:
        """Return the age of data with a stamp, s; 0 without a stamp, or if it is ahead of now."""
        return max(self.nanoseconds() - stamp.to_nsec(), 0) * 1e-9 if stamp else 0.0

    def timer(
        self,
        period: float,
        callback: Callable[[], None],
        steady: bool = False,
        stagger: bool = False,
    ) -> Timer:
        """Call ``callback()`` every ``period`` seconds; ticks that are missed are skipped.

        With ``steady`` the period is by the machine's clock even if time is simulated; with
        ``stagger`` the ticks differ from those of other timers, for reports of many nodes. See
        `TimerQueue.add`.
        """
        guarded = self.guard(callback)

        def tick():
            for latest in self._latest:
                latest.deliver()
            guarded()

        tick.__qualname__ = getattr(callback, "__qualname__", tick.__qualname__)
        timer = self._process.timers(steady).add(period, tick, stagger)
        self._undo.append(timer.stop)
        return timer

    def submit(self, callback: Callable[..., None], *arguments: Any) -> None:
        """Queue a call ``callback(*arguments)``; from any thread of the node."""
        process, guarded = self._process, self.guard(callback)
        if process.recorder is None or process.executor.is_in_turn:
            self._submit(guarded, *arguments)
        else:
            process.recorder.submit(self.name, callback, guarded, arguments)

    def input(
        self, callback: Callable[..., None], decode: Callable[[Any], Any] = lambda plain: plain
    ) -> Callable[..., None]:
        """Return a function for the node's threads that queues ``callback(argument)``.

        Unlike with `submit`, a journal has the argument, if there is one, as JSON, and
        ``decode(plain)`` returns it again. Created in the same order each time.
        """
        process, guarded = self._process, self.guard(callback)
        process.inputs.append((guarded, decode))
        if process.recorder is None:
            return partial(self._submit, guarded)
        return partial(process.recorder.submit_input, len(process.inputs), guarded)

    def start(self, begin: Callable[[], None]) -> None:
        """Call ``begin()``, which starts a thread that uses functions of `input`.

        It is not called in a replay: the journal has what the thread has passed on.
        """
        if not self._process.is_replay:
            begin()

    def task(self, name: str, work: Callable[[], None]) -> None:
        """Do ``work()``, which waits for something outside by `outside`, or by `value`.

        It has a thread with a name, and its turn like a callback while it does not wait.
        """

        def run():
            try:
                work()
            except Exception as error:
                self.report_fault(work, error)

        self._process.tasks.start(name, run)

    def outside(self, call: Callable[..., object], *arguments: Any) -> None:
        """Call ``call(*arguments)``, which waits: the turn of a task is given up meanwhile.

        It is not called in a replay.
        """
        self._process.tasks.outside(call, *arguments)

    @property
    def has_journal(self) -> bool:
        """Whether values are in a journal, which is written, or run again."""
        return self.is_replay or self._process.recorder is not None

    @property
    def is_replay(self) -> bool:
        """Whether a journal has all that comes from outside, which is not there."""
        return self._process.is_replay

    def random_seed(self) -> int:
        """Return a random seed, 32 bits: callbacks draw no random numbers elsewhere."""
        return self._process.transport.random_seed()

    def broadcast_poses(
        self, refresh: Callable[[], None] | None = None
    ) -> Callable[[list[StampedPose]], None]:
        """Announce /tf and return ``broadcast(list of StampedPose)``; see `Transforms`.

        For ``refresh()`` see `Transforms.add_source`.
        """
        if refresh is not None:
            self._process.transforms.add_source(self.guard(refresh))
        return self._process.transforms.pose_broadcaster()

    def on_pose(self, frame: str, period: float, callback: Callable[[], None]) -> None:
        """Call ``callback()`` for new poses of a frame, once in ``period`` (s, by stamps)."""
        guarded = self.guard(callback)
        self._process.transforms.on_pose(frame, period, lambda: self._submit(guarded))

    @property
    def is_ending(self) -> bool:
        """Whether the process ends as soon as its flights have ended: none may begin."""
        return self._process.is_ending

    def inhibit_shutdown(
        self, land: Callable[[str], None] = lambda name: None
    ) -> Callable[[bool], None]:
        """Return ``publish(in_flight)``, which publishes whether this node has a flight.

        Processes with nodes that are needed in flight do not end at SIGINT before it has ended.
        ``land(name)`` is called in flight when another node that the flight needs is to end.
        """
        publish = self._process.flights.inhibit_shutdown(self.name, partial(self.submit, land))
        self._undo.append(lambda: publish(False))
        return publish

    def advertise_landing_request(self) -> Callable[[], None]:
        """Return ``request()``, for `Node.prepare_shutdown` of a node that flights need.

        It asks the nodes that inhibit shutdown to end these flights. Announced beforehand, since
        ``rosnode kill`` leaves no time for that.
        """
        return self._process.flights.advertise_landing_request(self.name)

    def on_fault(self, enter_safe_state: Callable[[], None]) -> None:
        """Call ``enter_safe_state()`` after a callback of this node has raised."""
        self._faults.enter_safe_state = enter_safe_state

    def guard(self, callback: Callable[..., Any]) -> Callable[..., None]:
        """Return ``callback`` with its exceptions caught and reported."""

        def guarded(*args):
            if self.is_closed:
                return
            try:
                callback(*args)
            except Exception as error:
                self.report_fault(callback, error)

        return guarded


class _Reply(Future[Any]):
    """The response to a call; functions added to it are callbacks of the node.

    A plain future would only log their exceptions, and the node would not enter its safe state.
    """

    def __init__(self, handle: NodeHandle):
        super().__init__()
        self._guard = handle.guard

    @override
    def add_done_callback(self, fn: Callable[[Future[Any]], object]) -> None:
        super().add_done_callback(self._guard(fn))
