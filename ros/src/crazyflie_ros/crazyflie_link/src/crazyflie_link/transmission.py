"""Packets to a vehicle and its answers: a thread that sends, and requests with time limits.

cflib's radio driver blocks a sender for up to 2 s when the vehicle is out of range; with a thread
of its own for each link no caller is blocked. CRTP has no request numbers: an answer is known by
its port, its channel and its first bytes. A late answer to an earlier, equal request cannot be
distinguished from the expected one.
"""

import contextlib
import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass

from crazyflie_link.errors import LinkLostError, NoReplyError

_MOST_COMMANDS = 256

_log = logging.getLogger(__name__)

Send = Callable[[], None]  #: Sends something.
#: Returns whether a packet is sent; called in the thread that sends, right before the packet.
MaySend = Callable[[], bool]


REPLY_LIMIT = 1.0  #: Time limit of a reply, s.
RESEND_PERIOD = 0.2  #: Time after which a request is sent again, s; as cflib does.


@dataclass(frozen=True)
class Request:
    """A request to the vehicle, and its answer: port, channel, first bytes, time limit (s).

    ``what`` names the request in errors, such as "the takeoff command". Without ``resend`` it is
    sent once: doing it twice is different from doing it once. ``accepts(data)`` returns whether
    data with the prefix are the answer, not that to an earlier request.
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


class Transmission:
    """Packets to be sent: commands in their order, the latest of each stream; and requests."""

    def __init__(self) -> None:
        self._commands: deque[Send] = deque()
        self._streams: dict[str, Send] = {}
        # The answers to come, in the order of their requests.
        self._pending: dict[Future[bytes], Request] = {}
        self._changed = threading.Condition()
        self._closed: str | None = None
        threading.Thread(target=self._run, name="crazyflie-transmit", daemon=True).start()

    def put(self, send: Send, urgent: bool = False) -> None:
        """Queue ``send()`` behind the commands before it.

        An urgent one goes first, and discards all streams. `LinkLostError` if this is closed, or
        the queue is full: the link is stuck.
        """
        with self._changed:
            self._check_open()
            if urgent:
                self._streams.clear()
                self._commands.appendleft(send)
            elif len(self._commands) >= _MOST_COMMANDS:
                raise LinkLostError(f"{_MOST_COMMANDS} packets wait to be sent: the link is stuck")
            else:
                self._commands.append(send)
            self._changed.notify()

    def put_latest(self, stream: str, send: Send) -> None:
        """Queue ``send()`` in place of the one that still waits on this stream."""
        with self._changed:
            self._check_open()
            self._streams[stream] = send
            self._changed.notify()

    def discard(self, stream: str) -> None:
        """Remove the ``send`` that waits on a stream."""
        with self._changed:
            self._streams.pop(stream, None)

    def request(self, send: Send, request: Request, put: Callable[[Send], None]) -> bytes:
        """Have ``put`` queue a request, and return the data of the answer; blocks.

        One that still waits in the queue when this ends is withdrawn. Raises `NoReplyError` after
        the limit, `LinkLostError` if the link ends meanwhile.
        """
        answer: Future[bytes] = Future()
        with self._changed:
            self._check_open(f"{request.what}: ")
            self._pending[answer] = request

        def send_while_pending() -> None:
            if answer in self._pending:
                send()

        left = request.limit
        deadline = time.monotonic() + left
        try:
            while left > 0.0:
                put(send_while_pending)
                with contextlib.suppress(TimeoutError):
                    return answer.result(min(RESEND_PERIOD, left) if request.resend else left)
                left = deadline - time.monotonic() if request.resend else 0.0
            raise NoReplyError(
                f"{request.what}: the vehicle has not replied within {request.limit:g} s"
                + ("" if request.resend else "; it may or may not have been carried out")
            )
        finally:
            with self._changed:
                self._pending.pop(answer, None)

    def receive(self, port: int, channel: int, data: bytes) -> None:
        """Give a packet that arrived to the oldest request that it answers."""
        with self._changed:
            for answer, request in self._pending.items():
                if request.is_answer(port, channel, data):
                    del self._pending[answer]
                    answer.set_result(data)
                    return

    def close(self, reason: str = "the link is closed") -> None:
        """Stop sending, and discard the queue; requests, and later calls, fail with the reason."""
        with self._changed:
            self._closed = reason
            closed, self._pending = self._pending, {}
            self._changed.notify()
        for answer, request in closed.items():
            answer.set_exception(LinkLostError(f"{request.what}: {reason}"))

    def _check_open(self, what=""):
        if self._closed is not None:
            raise LinkLostError(f"{what}{self._closed}")

    def _is_busy(self):
        return self._closed is not None or self._commands or self._streams

    def _run(self):
        while True:
            with self._changed:
                self._changed.wait_for(self._is_busy)
                if self._closed is not None:
                    return
                if self._commands:
                    send = self._commands.popleft()
                else:
                    send = self._streams.pop(next(iter(self._streams)))
            try:
                send()
            except Exception:
                # Whatever cflib raises, the next command must go out.
                _log.exception("a packet could not be sent")
