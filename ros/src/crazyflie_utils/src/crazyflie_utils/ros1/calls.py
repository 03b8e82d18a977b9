"""Calls of services, answered and made, that end."""

import ast
import contextlib
import threading
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError, wait
from time import monotonic
from typing import Any

import rosgraph
import rospy

from crazyflie_utils.transport import ServiceError

#: How long, in s of the machine's clock, the caller of a service waits while simulated time stands
#: still.
_STALL_LIMIT = 5.0


#: Calls of one service that may be without an answer. rospy waits for one without a limit, in a
#: thread that nothing can end.
_MAX_CALLS = 8


class ServiceCaller:
    """Calls services, each call in a thread of its own.

    Those of this process, ``own``, are called without a connection: a fleet's are a hundred.
    """

    def __init__(self) -> None:
        self.own: dict[str, rospy.Service] = {}
        self._calls: dict[str, threading.Semaphore] = {}

    def call(
        self, name: str, rospy_name: str, service_type: type, request: Any, limit: float
    ) -> Future[Any]:
        """Call a service that rospy knows by ``rospy_name``; give up on it after ``limit`` (s)."""
        own = self.own.get(name)
        future: Future[Any] = Future()
        calls = self._calls.setdefault(name, threading.Semaphore(_MAX_CALLS))
        if not calls.acquire(blocking=False):
            _fail(future, f"{name} has not answered {_MAX_CALLS} earlier calls")
            return future
        threading.Thread(
            target=_call,
            args=(rospy_name, service_type, request, limit, future, calls, own),
            daemon=True,
        ).start()
        timer = threading.Timer(
            limit, _fail, (future, f"{name} has not answered within {limit:g} s")
        )
        timer.daemon = True
        timer.start()
        future.add_done_callback(lambda _: timer.cancel())
        return future


def wait_for_answer(answer: Future[Any], name: str, time: Callable[[], float]) -> Any:
    """Return the outcome of ``answer``, for the caller of the service ``name``.

    `ServiceError` is the service's; or the process ends, or ``time()`` stands still, before.
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
        if own is not None and _answers(own):
            response = own.handler(request)
        else:
            rospy.wait_for_service(name, timeout=limit)
            response = rospy.ServiceProxy(name, service_type)(request)
    except Exception as error:
        # rospy has many, of which not all are its own.
        _fail(future, _reason(error))
    else:
        with contextlib.suppress(InvalidStateError):
            future.set_result(response)
    finally:
        calls.release()


def _reason(error):
    """Return what a service says; rospy puts its own words around that."""
    text = str(error)
    _, found, said = text.partition(" responded with an error: ")
    if not found:
        return text
    try:
        words = ast.literal_eval(said).decode()
    except (SyntaxError, ValueError, AttributeError):
        return text
    return words.removeprefix("service cannot process request: ")


def _answers(own):
    """Return whether the master has no other service of this name, or is gone."""
    try:
        return rosgraph.Master(rospy.get_name()).lookupService(own.resolved_name) == own.uri
    except rosgraph.MasterException:
        return False
    except OSError:
        return True


def _fail(future, text):
    # The answer and the limit may come at the same moment; the first one counts.
    with contextlib.suppress(InvalidStateError):
        future.set_exception(ServiceError(text))
