"""Services that are answered in their turn, at once or later."""

import time
import traceback
from concurrent.futures import Future, wait

from crazyflie_utils.transport import ServiceError

_STALL_LIMIT = 5.0
"""How long, in s of the machine's clock, a caller waits while time stands still."""


class Service:
    """A service of a node.

    Parameters
    ----------
    process : Process
    handle : NodeHandle
        Of the node, for its name and its log.
    callback : callable
        See `NodeHandle.advertise_service`.
    faults : Faults
        Told of what the callback raises.
    """

    def __init__(self, process, handle, callback, faults):
        self._process = process
        self._handle = handle
        self._callback = callback
        self._faults = faults

    def begin(self, request) -> Future:
        """Have a request served in its turn; return a future of the response, at once."""
        answer = Future()
        self._process.executor.submit(lambda: self._serve(request, answer))
        return answer

    def settle(self, answer: Future):
        """Wait for an answer that `begin` has returned.

        Raises
        ------
        ServiceError
            The service refuses or fails; or its process ends or simulated time
            stands still before it has answered.
        """
        clock = self._process.clock
        seen, seen_at = clock.time(), time.monotonic()
        while not wait([answer], timeout=0.1).done:
            if self._process.transport.is_shutdown():
                raise ServiceError(f"{self._handle.name} is shutting down")
            if clock.time() != seen:
                seen, seen_at = clock.time(), time.monotonic()
            elif time.monotonic() - seen_at > _STALL_LIMIT:
                raise ServiceError(f"{self._handle.name}: /clock stands still")
        return answer.result()

    def _serve(self, request, answer):
        if self._handle.is_closed:
            answer.set_exception(ServiceError(f"{self._handle.name} has ended this service"))
            return
        try:
            response = self._callback(request)
        except ServiceError as error:
            answer.set_exception(error)
        except Exception as error:
            self._faults.report(self._callback, error)
            answer.set_exception(ServiceError(f"{self._handle.name}: {error!r}"))
        else:
            if isinstance(response, Future):
                response.add_done_callback(lambda done: pass_on(done, answer, self._handle))
            else:
                answer.set_result(response)


def pass_on(done: Future, to: Future, handle) -> None:
    """Let one future have the outcome of another, any error as a `ServiceError`."""
    if not to.set_running_or_notify_cancel():
        return
    if done.cancelled():
        to.set_exception(ServiceError(f"{handle.name}: cancelled"))
        return
    error = done.exception()
    if error is None:
        to.set_result(done.result())
    elif isinstance(error, ServiceError):
        to.set_exception(error)
    else:
        handle.error(f"a service failed\n{''.join(traceback.format_exception(error))}")
        to.set_exception(ServiceError(f"{handle.name}: {error!r}"))
