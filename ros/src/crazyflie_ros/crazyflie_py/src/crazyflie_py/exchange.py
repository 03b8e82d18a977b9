"""Questions to the vehicle and its answers, with a time limit.

CRTP has no request numbers: an answer is known by its port, its channel and its
first bytes.
"""

import threading
import time

from crazyflie_py.errors import LinkLostError, NoReplyError
from crazyflie_py.outbox import Send

REPLY_LIMIT = 1.0
"""How long to wait for a reply, s."""

RESEND_PERIOD = 0.2
"""How long to wait before a request is sent again, s; as cflib does."""


class _Waiter:
    def __init__(self, port: int, channel: int, prefix: bytes):
        self.key = (port, channel)
        self.prefix = prefix
        self.answer: bytes | None = None
        self.done = threading.Event()


class Exchange:
    """Pair answers with the questions that wait for them."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiters: list[_Waiter] = []
        self._closed: str | None = None

    def hear(self, port: int, channel: int, data: bytes) -> None:
        """Give a packet that arrived to whoever has waited for it longest."""
        with self._lock:
            for waiter in self._waiters:
                if waiter.key == (port, channel) and data.startswith(waiter.prefix):
                    self._waiters.remove(waiter)
                    waiter.answer = data
                    waiter.done.set()
                    return

    def ask(
        self,
        send: Send,
        port: int,
        channel: int,
        prefix: bytes,
        what: str,
        resend: bool = True,
        limit: float = REPLY_LIMIT,
    ) -> bytes:
        """Send a request and return the data of the answer; blocks.

        Parameters
        ----------
        send : callable
            Sends the request.
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
            s.

        Raises
        ------
        NoReplyError
            No answer within the limit.
        LinkLostError
            The link ended meanwhile.
        """
        waiter = _Waiter(port, channel, prefix)
        with self._lock:
            if self._closed is not None:
                raise LinkLostError(f"{what}: {self._closed}")
            self._waiters.append(waiter)
        deadline = time.monotonic() + limit
        try:
            send()
            while not waiter.done.wait(self._patience(deadline, resend)):
                if time.monotonic() >= deadline:
                    raise NoReplyError(
                        f"{what}: the vehicle has not replied within {limit:g} s"
                        + ("" if resend else "; it may or may not have been carried out")
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
        """Let everybody who waits, and who asks later, fail with `LinkLostError`."""
        with self._lock:
            self._closed = reason
            waiters, self._waiters = self._waiters, []
        for waiter in waiters:
            waiter.done.set()

    @staticmethod
    def _patience(deadline: float, resend: bool) -> float:
        left = max(0.0, deadline - time.monotonic())
        return min(RESEND_PERIOD, left) if resend else left
