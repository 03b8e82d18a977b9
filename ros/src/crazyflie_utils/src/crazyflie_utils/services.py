"""Services that are answered in their turn, at once or later."""

import traceback
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from typing_extensions import override

from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.transport import ServiceError

#: The `NodeHandle` of the node that offers or calls the service; its module imports this one.
Handle = Any


def serve(
    callback: Callable[[Any], Any], request: Any, answer: Future[Any], handle: Handle
) -> None:
    """Give ``answer`` the response to a request, or a `ServiceError`.

    That is now, or when the future that the callback returns is done; see
    `NodeHandle.advertise_service`.
    """
    if handle.is_closed:
        answer.set_exception(ServiceError(f"{handle.name} has ended this service"))
        return
    try:
        response = callback(request)
    except (ServiceError, RefusalError) as reason:
        answer.set_exception(ServiceError(str(reason)))
    except Exception as error:
        handle.report_fault(callback, error)
        answer.set_exception(ServiceError(f"{handle.name}: {error!r}"))
    else:
        if isinstance(response, Future):
            response.add_done_callback(lambda done: forward(done, answer, handle))
        else:
            answer.set_result(response)


class Reply(Future[Any]):
    """The response to a call; what is added to it is a callback of the node.

    A plain future would only log what that raises, and the node would not be made safe.
    """

    def __init__(self, handle: Handle):
        super().__init__()
        self._guard = handle.guard

    @override
    def add_done_callback(self, fn: Callable[[Future[Any]], object]) -> None:
        super().add_done_callback(self._guard(fn))


def forward(done: Future[Any], to: Future[Any], handle: Handle) -> None:
    """Let one future have the outcome of another, any error as a `ServiceError`."""
    if not to.set_running_or_notify_cancel():
        return
    if done.cancelled():
        to.set_exception(ServiceError(f"{handle.name}: cancelled"))
        return
    error = done.exception()
    if error is None:
        to.set_result(done.result())
    elif isinstance(error, (ServiceError, RefusalError)):
        to.set_exception(ServiceError(str(error)))
    else:
        handle.error(f"a service failed\n{''.join(traceback.format_exception(error))}")
        to.set_exception(ServiceError(f"{handle.name}: {error!r}"))
