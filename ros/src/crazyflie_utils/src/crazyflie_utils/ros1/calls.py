"""Calls of services, answered and made, with time limits."""

import ast
import contextlib
import socket
import threading
import xmlrpc.client
from collections.abc import Callable, Iterable
from concurrent.futures import Future, InvalidStateError, wait
from functools import partial
from queue import SimpleQueue
from time import monotonic
from typing import Any, NamedTuple

import rospy
from rospy.impl.tcpros_base import TCPROSTransport

from crazyflie_utils.refusal import ServiceError
from crazyflie_utils.ros1.master_watch import NO_ANSWER, bounded_master
from crazyflie_utils.steps import copy_outcome
from crazyflie_utils.topics import Serve

#: Longest time that the caller of a service waits while simulated time stands still (s of the
#: machine's clock).
_STALL_LIMIT = 5.0

_MASTER_LIMIT = 2.0  #: Longest time for an answer of the master (s).
_MAX_CALLS = 8  #: Largest number of unanswered calls of one service.

_in_thread = threading.local()


class OwnService(NamedTuple):
    """A service of this process, and what answers it."""

    service: rospy.Service
    serve: Serve


class ServiceCaller:
    """Calls services of other processes, each call in a thread of its own.

    Services of this process, ``own``, are called without a connection, all in one thread that waits
    for no answer: a fleet has a hundred, and as many threads would hold up what answers them.
    """

    def __init__(self) -> None:
        self.own: dict[str, OwnService] = {}
        self._calls: dict[str, threading.Semaphore] = {}
        self._own_calls: SimpleQueue[tuple[OwnService, Any, Future[Any], Callable[[], None]]]
        self._own_calls = SimpleQueue()
        self._has_thread = False

    def call(
        self,
        name: str,
        rospy_name: str,
        service_type: type,
        request: Any,
        limit: float,
        start_limit: float,
    ) -> Future[Any]:
        """Call a service that rospy knows by ``rospy_name``.

        The call is withdrawn if the service has not been reached after ``start_limit`` (s), or has
        not answered after ``limit`` (s): its connection ends, and a node that was stopped
        meanwhile does not obey it when it goes on.
        """
        own = self.own.get(name)
        future: Future[Any] = Future()
        calls = self._calls.setdefault(name, threading.Semaphore(_MAX_CALLS))
        if not calls.acquire(blocking=False):
            _fail(future, f"{name} has not answered {_MAX_CALLS} earlier calls")
            return future
        connection = _Connection(rospy_name, service_type)

        def call():
            threading.Thread(
                target=_call, args=(connection, request, limit, future), daemon=True
            ).start()

        future.add_done_callback(lambda _: calls.release())
        if own is None:
            call()
        else:
            self._call_own(own, request, future, call)

        def give_up(text, unless_sent):
            if connection.close(unless_sent):
                _fail(future, text)

        _after(limit, future, give_up, f"{name} has not answered within {limit:g} s", False)
        if start_limit < limit and own is None:
            text = f"{name} has not been reached within {start_limit:g} s; nothing was done"
            _after(start_limit, future, give_up, text, True)
        return future

    def _call_own(self, own, request, future, call):
        """Call a service of this process, or else ``call()`` the one that has taken its name."""
        self._own_calls.put((own, request, future, call))
        if not self._has_thread:
            self._has_thread = True
            threading.Thread(target=self._call_queued, daemon=True).start()

    def _call_queued(self):
        while True:
            calls = [self._own_calls.get()]
            while not self._own_calls.empty():
                calls.append(self._own_calls.get())
            ours = _ours([own.service for own, *_ in calls])
            for own, request, future, call in calls:
                if own.service.resolved_name in ours:
                    answer = own.serve(request, future.done)
                    answer.add_done_callback(partial(copy_outcome, to=future))
                else:
                    call()


class _Connection:
    """The connection of one call."""

    def __init__(self, name: str, service_type: type):
        self.name, self._type = name, service_type
        self._transport: TCPROSTransport | None = None
        self.is_sent = self.is_closed = False
        self._lock = threading.Lock()

    def close(self, unless_sent: bool = False) -> bool:
        """End the connection, for good; return whether that was done."""
        with self._lock:
            if unless_sent and self.is_sent:
                return False
            self.is_closed = True
            if self._transport is not None:
                self._transport.close()
            return True

    def exchange(self, request: Any) -> Any:
        """Return the response; blocks."""
        proxy = rospy.ServiceProxy(self.name, self._type)
        address, port = rospy.core.parse_rosrpc_uri(proxy._get_service_uri(request))
        with self._lock:
            self._expect_open()
            transport = self._transport = TCPROSTransport(proxy.protocol, proxy.resolved_name)
        # Only an answer to the header shows that the service's process runs.
        transport.connect(address, port, proxy.uri)
        with self._lock:
            self._expect_open()
            self.is_sent = True
        transport.send_message(request, 1)
        (response,) = transport.receive_once()
        return response

    def _expect_open(self):
        if self.is_closed:
            raise ServiceError(f"{self.name}: the call was given up")


class WithdrawableService(rospy.Service):
    """A service whose handler can check whether the caller still waits.

    ``is_withdrawn()`` returns it while the handler runs; other threads may call it, too.
    """

    def handle(self, transport: TCPROSTransport, header: dict[str, str]) -> None:
        """Answer the requests of a connection, in its own thread."""
        _in_thread.is_withdrawn = partial(has_closed, transport.socket)
        super().handle(transport, header)


def withdrawn() -> Callable[[], bool]:
    """Return a function that returns whether the call that this thread answers was withdrawn."""
    return getattr(_in_thread, "is_withdrawn", lambda: False)


def has_closed(connection: socket.socket) -> bool:
    """Return whether the other side has closed a connection that has no timeout."""
    try:
        return not connection.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT)
    except BlockingIOError:
        return False
    except OSError:
        return True


def _after(delay, future, act, *arguments):
    timer = threading.Timer(delay, act, arguments)
    timer.daemon = True
    timer.start()
    future.add_done_callback(lambda _: timer.cancel())


def wait_for_answer(answer: Future[Any], name: str, time: Callable[[], float]) -> Any:
    """Return the outcome of ``answer``, for the caller of the service ``name``.

    `ServiceError`: the service refuses, or before its answer the process ends or ``time()`` stands
    still.
    """
    seen, seen_at = time(), monotonic()
    while not wait([answer], timeout=0.1).done:
        # Until then callbacks run: vehicles may be landed by a service of this very process.
        if rospy.core.is_shutdown():
            raise ServiceError(f"{name}: the node is shutting down")
        if time() != seen:
            seen, seen_at = time(), monotonic()
        elif monotonic() - seen_at > _STALL_LIMIT:
            text = f"/clock has stood still for {_STALL_LIMIT:g} s; it may still be done"
            raise ServiceError(f"{name}: {text}")
    return answer.result()


def _call(connection, request, limit, future):
    try:
        try:
            response = connection.exchange(request)
        except Exception:
            if connection.is_sent or connection.is_closed:
                raise
            rospy.wait_for_service(connection.name, timeout=limit)
            response = connection.exchange(request)
    except Exception as error:
        # rospy raises many types, not all its own; one follows from giving up the call.
        if not connection.is_closed:
            _fail(future, _reason(error))
    else:
        with contextlib.suppress(InvalidStateError):
            future.set_result(response)
    finally:
        connection.close()


def _reason(error):
    """Return the error text of a service, without the words that rospy adds."""
    text = str(error)
    _, found, said = text.partition(" responded with an error: ")
    if not found:
        return text
    try:
        words = ast.literal_eval(said).decode(errors="replace")
    except (SyntaxError, ValueError, AttributeError):
        return text
    return words.removeprefix("service cannot process request: ")


def _ours(services: Iterable[rospy.Service]) -> set[str]:
    """Return the names for which the master has no service but these; all if it is gone."""
    uris = {each.resolved_name: each.uri for each in services}
    lookups: Any = xmlrpc.client.MultiCall(bounded_master(rospy.get_name(), _MASTER_LIMIT).handle)
    for name in uris:
        lookups.lookupService(rospy.get_name(), name)
    try:
        answers = zip(uris.items(), lookups(), strict=True)
        return {name for (name, uri), (_, _, known) in answers if known == uri}
    except NO_ANSWER:
        return {*uris}


def _fail(future, text):
    # The answer and the time limit may come at the same moment; the first one is used.
    with contextlib.suppress(InvalidStateError):
        future.set_exception(ServiceError(text))
