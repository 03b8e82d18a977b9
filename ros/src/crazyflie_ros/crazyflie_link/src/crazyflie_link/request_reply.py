"""Requests to the vehicle and its answers, with a time limit.

CRTP has no request numbers: an answer is known by its port, its channel and its first bytes. A late
answer to an earlier, equal request cannot be distinguished from the expected one.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from crazyflie_link.errors import LinkLostError, NoReplyError
from crazyflie_link.transmit_queue import Send

REPLY_LIMIT = 1.0  #: Time limit of a reply, s.
RESEND_PERIOD = 0.2  #: Time after which a request is sent again, s; as cflib does.


@dataclass(frozen=True)
class Request:
    """A request to the vehicle, and its answer: port, channel, first bytes, time limit (s).

    What is requested is for errors, such as "the takeoff command". Without ``resend`` it is sent
    once: doing it twice is different from doing it once. ``accepts(data)`` returns whether data
    with the prefix are the answer, not that to an earlier request.
    """

    port: int
    channel: int
    prefix: bytes
    what: str
    resend: bool = True
    limit: float = REPLY_LIMIT
    accepts: Callable[[bytes], bool] = lambda data: True

    def is_answer(self, port: int, channel: int, data: bytes) -> bool:
        """Return whether a packet is the answer."""
        is_same = (port, channel) == (self.port, self.channel)
        return is_same and data.startswith(self.prefix) and self.accepts(data)


@dataclass(eq=False)
class _Pending:
    request: Request
    answer: bytes | None = None
    done: threading.Event = field(default_factory=threading.Event)


class RequestReply:
    """Pair answers with pending requests."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._pending: list[_Pending] = []
        self._closed: str | None = None

    def receive(self, port: int, channel: int, data: bytes) -> None:
        """Give a packet that arrived to the oldest request that it answers."""
        with self._lock:
            for pending in self._pending:
                if pending.request.is_answer(port, channel, data):
                    self._pending.remove(pending)
                    pending.answer = data
                    pending.done.set()
                    return

    def request(self, send: Send, request: Request) -> bytes:
        """Send a request and return the data of the answer; blocks.

        Raises `NoReplyError` after the limit, `LinkLostError` if the link ends meanwhile.
        """
        what = request.what
        pending = _Pending(request)
        with self._lock:
            if self._closed is not None:
                raise LinkLostError(f"{what}: {self._closed}")
            self._pending.append(pending)
        left = request.limit
        deadline = time.monotonic() + left
        try:
            send()
            while not pending.done.wait(min(RESEND_PERIOD, left) if request.resend else left):
                left = deadline - time.monotonic()
                if left <= 0.0:
                    raise NoReplyError(
                        f"{what}: the vehicle has not replied within {request.limit:g} s"
                        + ("" if request.resend else "; it may or may not have been carried out")
                    )
                send()
        finally:
            with self._lock:
                if pending in self._pending:
                    self._pending.remove(pending)
        if pending.answer is None:
            raise LinkLostError(f"{what}: {self._closed}")
        return pending.answer

    def close(self, reason: str) -> None:
        """Have all pending requests, and later ones, fail with `LinkLostError`."""
        with self._lock:
            self._closed = reason
            closed, self._pending = self._pending, []
        for pending in closed:
            pending.done.set()
