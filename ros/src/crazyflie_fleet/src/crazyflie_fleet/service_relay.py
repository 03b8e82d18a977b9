"""Services that are answered by other services."""

from concurrent.futures import Future
from typing import Any

from std_srvs.srv import Empty, EmptyRequest

from crazyflie_utils import NodeHandle

_CALL_TIMEOUT = 58.0  #: Of a takeoff or landing of the takeoff server, s of the machine's clock.


def relay(handle: NodeHandle, service: str, response_type: type) -> "Future[Any]":
    """Call a service of type Empty; return the future of a response of another type.

    An error after the future was set otherwise is logged.
    """
    answer: Future[Any] = Future()

    def on_done(done):
        error = done.exception()
        if answer.done():
            if error is not None:
                handle.error(str(error))
        elif error is None:
            answer.set_result(response_type())
        else:
            answer.set_exception(error)

    call = handle.call_service(service, Empty, EmptyRequest(), _CALL_TIMEOUT)
    call.add_done_callback(on_done)
    return answer
