"""The only door between a node and ROS: roscpp's NodeHandle for Python."""

import math
import time
from collections.abc import Callable, Hashable
from concurrent.futures import Future
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import genpy
import rosgraph.names
from geometry_msgs.msg import TransformStamped
from rosgraph_msgs.msg import Clock

from crazyflie_utils.parameter_types import ParameterType
from crazyflie_utils.parameters import REQUIRED, Declaration, Parameters, read_parameter
from crazyflie_utils.runtime import flights
from crazyflie_utils.runtime.faults import Faults
from crazyflie_utils.runtime.poses import StampedPose
from crazyflie_utils.runtime.services import Reply, pass_on, serve
from crazyflie_utils.runtime.throttle import Throttle
from crazyflie_utils.runtime.timers import Timer
from crazyflie_utils.runtime.topics import Publisher, Subscriber
from crazyflie_utils.vectors import is_finite

if TYPE_CHECKING:
    from crazyflie_utils.runtime.process import Process

P = TypeVar("P", bound=Parameters)
M = TypeVar("M", bound=genpy.Message)


class NodeHandle:
    """Names, parameters, topics, services, timers, time, tf and log of one node.

    The node's callbacks, whatever calls for them, run one at a time, and never
    at the same time as those of another node in the process. A callback that
    raises is logged once with its traceback, and the node is told so through
    `on_fault`; it will be called again.

    Parameters
    ----------
    process : Process
        What the nodes of a process share.
    name : str
        Absolute name of the node, such as /simulator.
    """

    def __init__(self, process: "Process", name: str):
        self._process = process
        self._name = name
        self._faults = Faults(self)
        self._throttle = Throttle()
        self._undo: list[Callable[[], None]] = []
        self._is_closed = False
        self._clock: Publisher | None = None

    def child(self) -> "NodeHandle":
        """Return another handle of the node, for what may be closed before the node ends.

        `close` takes down what was made through it. It may be used from any thread.
        """
        child = NodeHandle(self._process, self._name)
        child._faults = self._faults
        return child

    def close(self) -> None:
        """Take down all publishers, subscribers, services and timers of this handle.

        No callback that was registered through it begins any more.
        """
        self._is_closed = True
        while self._undo:
            self._undo.pop()()

    @property
    def is_closed(self) -> bool:
        """Whether `close` has been called."""
        return self._is_closed

    def end(self, status: int = 0) -> None:
        """End the process, and with it all its nodes, with an exit status."""
        self._process.end(status)

    # Names and parameters.

    @property
    def name(self) -> str:
        """Absolute name of the node."""
        return self._name

    def resolve(self, name: str) -> str:
        """Return the absolute name of a topic, service or parameter.

        A relative name is in the node's namespace, ``~name`` is the node's own.
        Remappings of the launch file apply.
        """
        return self._process.transport.remap(rosgraph.names.resolve_name(name, self._name))

    def load(
        self,
        parameters: type[P],
        on_change: Callable[[P], None] | None = None,
    ) -> P:
        """Return the node's own (private) parameters, all of them checked.

        Parameters
        ----------
        parameters : type
            Subclass of `Parameters`.
        on_change : callable, optional
            Offers the live ones to dynamic_reconfigure: ``on_change(parameters)`` is
            called between two other callbacks with all of them, checked, after some
            were changed. It may raise `ParameterError` to refuse.

        Raises
        ------
        ParameterError
            About everything that is not set though required, or not what is expected.
        """
        own = self._own_parameters()

        def get(name):
            full_name = self._parameter_name(name)
            if not full_name.startswith(self._name + "/"):
                return self._process.transport.get_param(full_name)
            value = own
            for key in full_name.removeprefix(self._name + "/").split("/"):
                if not isinstance(value, dict):
                    raise KeyError(name)
                value = value[key]
            return value

        loaded = parameters.read(get, self._parameter_name)
        if on_change is not None:
            # Here, since most processes do without.
            from crazyflie_utils.runtime.reconfiguration import Reconfiguration

            Reconfiguration(self, loaded, get, on_change)
        return loaded

    def _own_parameters(self):
        # In one request, however many there are.
        try:
            return self._process.transport.get_param(self._name)
        except KeyError:
            return {}

    def _parameter_name(self, name):
        return self.resolve(name if name.startswith("/") else "~" + name)

    def get_param(self, name: str, type: ParameterType, default: Any = REQUIRED) -> Any:  # noqa: A002
        """Return a parameter that cannot be declared: another's, or one of a changing name.

        Parameters
        ----------
        name : str
            A relative name is in the node's namespace, ``~name`` is the node's own.
        type : ParameterType
        default : object, optional
            Taken as it is when the parameter is not set.

        Raises
        ------
        ParameterError
            It is required but not set, or not what is expected.
        """
        declaration = Declaration(self.resolve(name), type, "", default, live=False)
        return read_parameter(declaration, self._process.transport.get_param)

    def set_param(self, name: str, value: Any) -> None:
        """Set a parameter that others may read; blocks for a few milliseconds.

        Parameters
        ----------
        name : str
            A relative name is in the node's namespace.
        value : bool, int, float, str, list or dict
            A dictionary takes the place of the whole namespace ``name``.
        """
        self._process.transport.set_param(self.resolve(name), value)

    # Topics and services.

    def publisher(self, topic: str, message_type: type, latch: bool = False) -> Publisher:
        """Announce a topic and return its publisher.

        With ``latch``, whoever subscribes later is sent the last message.
        """
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
    ) -> Subscriber:
        """Have ``callback(message)`` called for every message on a topic.

        The message belongs to everybody: it must not be changed. The subscriber that is
        returned tells whether there are publishers.

        Parameters
        ----------
        topic : str
        message_type : type
        callback : callable
        finite : str, optional
            A field of the message, such as "control", whose numbers must be finite.
            Other messages are dropped with a warning, and
        on_invalid : callable, optional
            is called instead, without arguments.
        """
        if finite:
            callback = self._finite_only(self.resolve(topic), finite, callback, on_invalid)
        guarded = self.guard(callback)
        submit = self._process.executor.submit
        subscriber = self._process.topics.subscribe(
            self.resolve(topic), message_type, lambda message: submit(partial(guarded, message))
        )
        self._undo.append(subscriber.close)
        return subscriber

    def _finite_only(self, topic, field, callback, on_invalid):
        def check(message):
            if is_finite(getattr(message, field)):
                callback(message)
                return
            self.warn(f"ignoring a message on {topic}: its {field} is not finite", throttle=1.0)
            if on_invalid is not None:
                on_invalid()

        return check

    def advertise_service(
        self, name: str, service_type: type, callback: Callable[[Any], Any]
    ) -> None:
        """Answer calls of a service.

        ``callback(request)`` returns the response; or, for work that takes time, a
        `concurrent.futures.Future` of it, so that the node goes on living
        meanwhile; or raises `ServiceError` with a text for the caller.
        """

        def begin(request):
            answer: Future[Any] = Future()
            self._process.executor.submit(partial(serve, callback, request, answer, self))
            return answer

        end = self._process.transport.advertise_service(
            self.resolve(name), service_type, begin, self._process.clock.time
        )
        self._undo.append(end)

    def call_service(
        self, name: str, service_type: type, request: Any, limit: float
    ) -> Future[Any]:
        """Call a service of any process, without waiting for it.

        Returns
        -------
        concurrent.futures.Future
            Of the response; or of a `ServiceError` when the service refuses, is
            not there, or has not answered after ``limit`` seconds of the
            machine's clock. What is added to it with ``add_done_callback`` runs
            like any callback; none may wait for it.
        """
        outcome = Reply(self)
        reply = self._process.transport.call_service(
            self.resolve(name), service_type, request, limit
        )
        submit = self._process.executor.submit
        reply.add_done_callback(lambda reply: submit(partial(pass_on, reply, outcome, self)))
        return outcome

    def service_nodes(self) -> dict[str, str]:
        """Return every service that is offered now -> its node; blocks for a few milliseconds."""
        return self._process.transport.service_nodes()

    # Time.

    @property
    def uses_sim_time(self) -> bool:
        """Whether the node lives by simulated time (/use_sim_time)."""
        return self._process.uses_sim_time

    def time(self) -> float:
        """Return seconds for measuring intervals: simulated, or the machine's steady clock."""
        return self._process.clock.time()

    def stamp(self, moment: float | None = None) -> genpy.Time:
        """Return the ROS time of a moment of `time`, by default now."""
        return self._process.clock.stamp(moment)

    def nanoseconds(self, moment: float | None = None) -> int:
        """Return the same as `stamp` in whole ns, for a `StampedPose`."""
        return self._process.clock.nanoseconds(moment)

    def timer(self, period: float, callback: Callable[[], None], steady: bool = False) -> Timer:
        """Have ``callback()`` called every ``period`` seconds of `time`.

        With ``steady`` the period is of the machine's clock also when time is
        simulated. Ticks that are missed are skipped.
        """
        timer = self._process.add_timer(period, self.guard(callback), steady)
        self._undo.append(timer.stop)
        return timer

    def submit(self, callback: Callable[..., None], *arguments: Any) -> None:
        """Have ``callback(*arguments)`` called in its turn with all other callbacks.

        This is how threads of a node's own hand over to it.
        """
        self._process.executor.submit(partial(self.guard(callback), *arguments))

    def clock_publisher(self) -> Callable[..., None]:
        """Return ``set_clock(*moments)``, which moves simulated time to moments (s) for everybody.

        Other processes are told of all of them, in one go. In this process time moves to the last
        one, after the present callback; then the timers that are due run.
        """
        publisher = self._process.topics.publisher("/clock", Clock, latch=False)
        self._clock = publisher

        def set_clock(*moments: float) -> None:
            stamp = self.stamp(moments[-1])
            self._process.transport.clock_was_set(stamp)
            before = [Clock(self.stamp(each)) for each in moments[:-1]]
            publisher.publish(Clock(stamp), before)

        return set_clock

    def next_event(self) -> float:
        """Return the next moment, s, at which simulated time has to stop.

        That is when a timer of this process is due; or at once, where somebody in it listens to
        the clock.
        """
        # One listener is the process itself.
        if self._clock is None or self._clock.is_read_here(beside=1):
            return -math.inf
        return self._process.next_simulated_deadline()

    def announce_flights(self) -> Callable[[bool], None]:
        """Return ``tell(in_flight)``, which tells every process of flights that this node ends.

        Processes with nodes that are needed in flight do not end at SIGINT before it.
        """
        tell, close = flights.announce(self._process, self._name)
        self._undo.append(close)
        return tell

    # tf.

    def broadcast_transforms(self) -> Callable[[list[TransformStamped]], None]:
        """Announce to tf and return ``broadcast(list of TransformStamped)``."""
        self._process.transforms.advertise()
        return self._process.transforms.broadcast

    def listen_to_transforms(self) -> Callable[[str, str], TransformStamped]:
        """Begin to listen to tf and return ``lookup(target, source)``.

        See `Transforms.lookup` for its result and its error.
        """
        self._process.transforms.listen()
        return self._process.transforms.lookup

    def broadcast_poses(
        self, refresh: Callable[[], None] | None = None
    ) -> Callable[[list[StampedPose]], None]:
        """Announce to tf and return ``broadcast(list of StampedPose)``, which is the quicker way.

        ``refresh()`` is called before a callback of this process looks poses up: as long as
        `poses_are_heard` is false, it is early enough to broadcast then.
        """
        transforms, executor = self._process.transforms, self._process.executor
        transforms.advertise()
        if refresh is not None:
            guarded = self.guard(refresh)
            transforms.on_lookup(lambda: guarded() if executor.is_running_here else None)
        return transforms.broadcast_poses

    def poses_are_heard(self) -> bool:
        """Tell whether anybody hears of each pose that is broadcast when it is."""
        return self._process.transforms.is_heard()

    def listen_to_poses(self) -> Callable[[str, str], StampedPose]:
        """As `listen_to_transforms`, for ``lookup(target, source)`` that returns a pose."""
        self._process.transforms.listen()
        return self._process.transforms.lookup_pose

    def on_pose(self, frame: str, period: float, callback: Callable[[], None]) -> None:
        """Have ``callback()`` called as soon as tf knows a new pose of a frame.

        Of poses that come oftener than every ``period`` (s, by their stamps) only so many are
        told of.
        """
        guarded, submit = self.guard(callback), self._process.executor.submit
        self._process.transforms.on_pose(frame, period, lambda: submit(guarded))

    def rejected_transforms(self) -> dict[str, int]:
        """Return how many transforms were not taken into tf in this process, reason to number."""
        return dict(self._process.transforms.rejected)

    # Log and faults.

    def info(self, text: str) -> None:
        """Log what an operator may want to know."""
        self._process.transport.log("info", f"{self._name}: {text}")

    def warn(self, text: str, throttle: float = 0.0, key: Hashable = None) -> None:
        """Log a warning; the same ``key`` (the text) at most once in ``throttle`` seconds.

        The seconds are those of the machine's clock, so that a simulation that
        runs fast does not flood the screen. A text that varies needs a key.
        """
        key = text if key is None else key
        if throttle > 0.0 and not self._throttle.passes(key, throttle, time.monotonic()):
            return
        self._process.transport.log("warn", f"{self._name}: {text}")

    def error(self, text: str) -> None:
        """Log what makes the node fail."""
        self._process.transport.log("error", f"{self._name}: {text}")

    def report_fault(self, callback: Callable[..., Any], error: Exception) -> None:
        """Log that a callback of this node has raised, and have the node made safe."""
        self._faults.report(callback, error)

    def on_fault(self, make_safe: Callable[[], None]) -> None:
        """Have ``make_safe()`` called after a callback of this node has raised."""
        self._faults.make_safe = make_safe

    def guard(self, callback: Callable[..., Any]) -> Callable[..., None]:
        """Return ``callback`` such that what it raises is reported and goes no further."""

        def guarded(*args):
            if self._is_closed:
                return
            try:
                callback(*args)
            except Exception as error:
                self.report_fault(callback, error)

        return guarded
