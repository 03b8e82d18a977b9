"""Requests to the vehicle and its answers, with a time limit.

CRTP has no request numbers: an answer is known by its port, its channel and its
first bytes, and by what it repeats of the request. A late answer to an earlier, equal request
cannot be told from the one that is waited for.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from crazyflie_link.errors import LinkLostError, NoReplyError
from crazyflie_link.outbox import Send

REPLY_LIMIT = 1.0
"""How long to wait for a reply, s."""

RESEND_PERIOD = 0.2
"""How long to wait before a request is sent again, s; as cflib does."""


@dataclass(frozen=True)
class Request:
    """A request to the vehicle, and how its answer is recognised.

    Attributes
    ----------
    port, channel : int
        Where the answer comes from.
    prefix : bytes
        What the answer's data begin with.
    what : str
        For the error, such as "the takeoff command".
    resend : bool
        Whether the request may be sent again when no answer comes: not when
        doing it twice is different from doing it once.
    limit : float
        How long to wait for the answer, s.
    accepts : callable
        ``accepts(data)`` tells whether data that begin so are the answer, not that to an earlier
        request.
    """

    port: int
    channel: int
    prefix: bytes
    what: str
    resend: bool = True
    limit: float = REPLY_LIMIT
    accepts: Callable[[bytes], bool] = lambda data: True


class _Waiter:
    def __init__(self, request: Request):
        self.request = request
        self.answer: bytes | None = None
        self.done = threading.Event()

    def takes(self, port: int, channel: int, data: bytes) -> bool:
        expected = self.request
        is_same = (port, channel) == (expected.port, expected.channel)
        return is_same and data.startswith(expected.prefix) and expected.accepts(data)


class Exchange:
    """Pair answers with the requests that wait for them."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiters: list[_Waiter] = []
        self._closed: str | None = None

    def receive(self, port: int, channel: int, data: bytes) -> None:
        """Give a packet that arrived to the request that has waited for it longest."""
        with self._lock:
            for waiter in self._waiters:
                if waiter.takes(port, channel, data):
                    self._waiters.remove(waiter)
                    waiter.answer = data
                    waiter.done.set()
                    return

    def ask(self, send: Send, request: Request) -> bytes:
        """Send a request and return the data of the answer; blocks.

        Raises
        ------
        NoReplyError
            No answer within the limit.
        LinkLostError
            The link ended meanwhile.
        """
        what = request.what
        waiter = _Waiter(request)
        with self._lock:
            if self._closed is not None:
                raise LinkLostError(f"{what}: {self._closed}")
            self._waiters.append(waiter)
        deadline = time.monotonic() + request.limit
        try:
            send()
            while not waiter.done.wait(self._wait_time(deadline, request.resend)):
                if time.monotonic() >= deadline:
                    raise NoReplyError(
                        f"{what}: the vehicle has not replied within {request.limit:g} s"
                        + ("" if request.resend else "; it may or may not have been carried out")
                    )
                send()
        finally:
            with self._lock:
                if waiter in self._waiters:
                    self._waiters.remove(waiter)
        if waiter.answer is None:
            raise LinkLostError(f"{what}: {self._closed}")
        return waiter.answer

    def close(self, reason: str) -> None:
        """Have all requests that wait, and later ones, fail with `LinkLostError`."""
        with self._lock:
            self._closed = reason
            waiters, self._waiters = self._waiters, []
        for waiter in waiters:
            waiter.done.set()

    @staticmethod
    def _wait_time(deadline: float, resend: bool) -> float:
        left = max(0.0, deadline - time.monotonic())
        return min(RESEND_PERIOD, left) if resend else left
