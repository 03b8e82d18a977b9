"""The world outside a process, as rospy shows it."""

import contextlib
import math
import threading
from collections import Counter
from collections.abc import Callable, Hashable, Iterator
from concurrent.futures import Future, InvalidStateError, wait
from functools import partial
from time import monotonic
from typing import Any

import genpy
import rosgraph
import rospy

from crazyflie_utils.parameters.writer import ParameterWriter
from crazyflie_utils.ros1 import internals as rospy_internals
from crazyflie_utils.ros1 import receiving as rospy_receiving
from crazyflie_utils.ros1 import sending as rospy_sending
from crazyflie_utils.throttle import Throttle
from crazyflie_utils.transport import (
    ExternalPublisher,
    ExternalSubscriber,
    ServiceError,
    Transport,
)

_QUEUE_SIZE = 100
"""Messages kept for a listener that does not keep up: a simulation that runs as fast as it
can fills a short queue faster than the listener gets its turn."""


_STALL_LIMIT = 5.0
"""How long, in s of the machine's clock, the caller of a service waits while simulated time
stands still."""


_MOST_CALLS = 8
"""Calls of one service that may be without an answer. rospy waits for one without a limit, in
a thread that nothing can end."""


class _RosPublisher(ExternalPublisher):
    def __init__(self, publisher: rospy.Publisher):
        self._publisher = publisher

    def has_subscribers(self) -> bool:
        implementation = self._publisher.impl
        return implementation is not None and bool(implementation.connections)

    def publish(self, *messages: genpy.Message) -> None:
        rospy_sending.publish(self._publisher, *messages)

    def close(self) -> None:
        self._publisher.unregister()


class _RosSubscriber(ExternalSubscriber):
    def __init__(self, subscriber: rospy.Subscriber):
        self._subscriber = subscriber

    def has_publishers(self) -> bool:
        return self._subscriber.get_num_connections() > 0

    def close(self) -> None:
        self._subscriber.unregister()


class RosTransport(Transport):
    """rospy, for a process that has called ``rospy.init_node``.

    Attributes
    ----------
    refused : collections.Counter
        How often peers did something wrong, by kind.
    """

    def __init__(self) -> None:
        self.refused: Counter[Hashable] = Counter()
        self._complaints = Throttle()
        rospy_internals.bear_hostile_newcomers(self._refuse)
        rospy_internals.allow_many_topics()
        rospy_internals.never_connect_to_oneself()
        rospy_sending.never_wait_for_subscribers()
        rospy_internals.never_fail_to_log()
        rospy_internals.check_topics_in_turns()
        rospy_internals.connect_once()
        self._remappings = rospy_internals.take_over_remappings()
        self._calls: dict[str, threading.Semaphore] = {}
        self._own_services: dict[str, rospy.Service] = {}
        self._parameter_writer = ParameterWriter(_write_param, partial(self.log, "warn"))
        self._services_at_start: dict[str, str] | None = None
        self._is_starting = False

    def receive(self, limits_rate: bool) -> None:
        """Get ready for what publishers may send; see `rospy_receiving`."""
        rospy_receiving.bear_hostile_publishers(self._refuse, limits_rate)

    @contextlib.contextmanager
    def starting(self) -> Iterator[None]:
        """Register with the master in one request, and ask it for others' services once."""
        self._is_starting = True
        try:
            with rospy_internals.registering_together():
                yield
        finally:
            self._is_starting, self._services_at_start = False, None

    def _refuse(self, text, key):
        # Once, since a peer that is wrong stays so; and of the first 64 only.
        if self._complaints.passes(key, math.inf, 0.0):
            self.log("warn", text)
        elif key not in self.refused:
            key = "others"
        self.refused[key] += 1

    def remap(self, name: str) -> str:
        """Return what the command line maps the name to."""
        return self._remappings.get(name, name)

    def get_param(self, name: str) -> Any:
        """Return a parameter from the parameter server."""
        return rospy.get_param(name)

    def set_param(self, name: str, value: Any) -> None:
        """Set a parameter on the parameter server."""
        rospy.set_param(name, value)

    def set_param_later(self, name: str, value: Any) -> None:
        """Set a parameter on the parameter server by a thread that may wait for it."""
        self._parameter_writer.set(name, value)

    def advertise(self, topic: str, message_type: type, latch: bool) -> ExternalPublisher:
        """Register a publisher with the master."""
        return _RosPublisher(
            rospy.Publisher(topic, message_type, latch=latch, queue_size=_QUEUE_SIZE)
        )

    def subscribe(
        self, topic: str, message_type: type, deliver: Callable[[Any], None]
    ) -> ExternalSubscriber:
        """Register a subscriber with the master."""
        return _RosSubscriber(rospy.Subscriber(topic, message_type, deliver, tcp_nodelay=True))

    def advertise_service(
        self,
        name: str,
        service_type: type,
        serve: Callable[[Any], Future[Any]],
        time: Callable[[], float],
    ) -> Callable[[], None]:
        """Register a service with the master.

        Raises
        ------
        ServiceError
            This process offers one of that name already.
        """

        def answer(request):
            try:
                return wait_for_answer(serve(request), name, time)
            except ServiceError as error:
                raise rospy.ServiceException(str(error)) from None

        try:
            service = rospy.Service(name, service_type, answer)
        except rospy.ServiceException as error:
            raise ServiceError(str(error)) from None
        self._own_services[name] = service

        def end():
            del self._own_services[name]
            service.shutdown("no longer offered")

        return end

    def call_service(
        self, name: str, service_type: type, request: Any, limit: float
    ) -> Future[Any]:
        """Call in a thread of its own, and give up on it after ``limit``.

        A service of this process is called without a connection: a fleet's are a hundred at once.
        """
        own = self._own_services.get(name)
        future: Future[Any] = Future()
        calls = self._calls.setdefault(name, threading.Semaphore(_MOST_CALLS))
        if not calls.acquire(blocking=False):
            _fail(future, f"{name} has not answered {_MOST_CALLS} earlier calls")
            return future
        threading.Thread(
            target=_call, args=(name, service_type, request, limit, future, calls, own), daemon=True
        ).start()
        timer = threading.Timer(
            limit, _fail, (future, f"{name} has not answered within {limit:g} s")
        )
        timer.daemon = True
        timer.start()
        future.add_done_callback(lambda _: timer.cancel())
        return future

    def service_nodes(self) -> dict[str, str]:
        """Ask the master."""
        if self._is_starting and self._services_at_start is not None:
            return self._services_at_start
        _, _, services = rosgraph.Master(rospy.get_name()).getSystemState()
        self._services_at_start = {name: nodes[0] for name, nodes in services}
        return self._services_at_start

    def log(self, level: str, text: str) -> None:
        """Log to the screen, the node's log file and /rosout."""
        _LOGGERS[level](text)

    def clock_was_set(self, stamp: genpy.Time) -> None:
        """Set rospy's own clock, which stamps the log."""
        rospy_internals.set_time(stamp)


def _write_param(name, value):
    # Not through rospy's own connection to the master, which other threads use.
    rosgraph.Master(rospy.get_name()).setParam(name, value)


_LOGGERS = {
    "debug": rospy.logdebug,
    "info": rospy.loginfo,
    "warn": rospy.logwarn,
    "error": rospy.logerr,
    "fatal": rospy.logfatal,
}


def wait_for_answer(answer: Future[Any], name: str, time: Callable[[], float]) -> Any:
    """Return the outcome of ``answer``, for the caller of the service ``name``.

    Raises
    ------
    ServiceError
        The service's; or the process ends, or ``time()`` stands still, before there
        is an outcome.
    """
    seen, seen_at = time(), monotonic()
    while not wait([answer], timeout=0.1).done:
        if rospy.core.is_shutdown_requested():
            raise ServiceError(f"{name}: the node is shutting down")
        if time() != seen:
            seen, seen_at = time(), monotonic()
        elif monotonic() - seen_at > _STALL_LIMIT:
            raise ServiceError(f"{name}: /clock stands still")
    return answer.result()


def _call(name, service_type, request, limit, future, calls, own):
    try:
        if own is not None and _answers(own, name):
            response = own.handler(request)
        else:
            rospy.wait_for_service(name, timeout=limit)
            response = rospy.ServiceProxy(name, service_type)(request)
    except Exception as error:
        # rospy has many, of which not all are its own.
        _fail(future, str(error))
    else:
        with contextlib.suppress(InvalidStateError):
            future.set_result(response)
    finally:
        calls.release()


def _answers(own, name):
    """Return whether the master has no other service of this name, or is gone."""
    try:
        return rosgraph.Master(rospy.get_name()).lookupService(name) == own.uri
    except rosgraph.MasterException:
        return False
    except OSError:
        return True


def _fail(future, text):
    # The answer and the limit may come at the same moment; the first one counts.
    with contextlib.suppress(InvalidStateError):
        future.set_exception(ServiceError(text))
