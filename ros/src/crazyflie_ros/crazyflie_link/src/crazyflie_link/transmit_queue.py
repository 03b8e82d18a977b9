"""One thread per link that sends, so that no caller ever blocks on a radio.

cflib's radio driver blocks a sender for up to 2 s when the vehicle is out of range. Of setpoints
and external positions, stale by then, only the latest is kept. Commands are sent in order.
"""

import logging
import threading
from collections import deque
from collections.abc import Callable

from crazyflie_link.errors import LinkLostError

_MOST_COMMANDS = 256

_log = logging.getLogger(__name__)

Send = Callable[[], None]  #: Sends something.


class TransmitQueue:
    """Packets to be sent: commands in their order, and the latest of each stream."""

    def __init__(self) -> None:
        self._commands: deque[Send] = deque()
        self._streams: dict[str, Send] = {}
        self._wake = threading.Condition()
        self._closed = False
        threading.Thread(target=self._run, name="crazyflie-transmit", daemon=True).start()

    def put(self, send: Send, urgent: bool = False) -> None:
        """Have ``send()`` called after the commands before it.

        An urgent one goes first, and discards all streams. `LinkLostError` if the queue is closed,
        or full: the link is stuck.
        """
        with self._wake:
            self._check_open()
            if urgent:
                self._streams.clear()
                self._commands.appendleft(send)
            elif len(self._commands) >= _MOST_COMMANDS:
                raise LinkLostError(f"{_MOST_COMMANDS} packets wait to be sent: the link is stuck")
            else:
                self._commands.append(send)
            self._wake.notify()

    def put_latest(self, stream: str, send: Send) -> None:
        """Have ``send()`` called, in the place of what is still queued on this stream."""
        with self._wake:
            self._check_open()
            self._streams[stream] = send
            self._wake.notify()

    def discard(self, stream: str) -> None:
        """Remove what is queued on a stream."""
        with self._wake:
            self._streams.pop(stream, None)

    def close(self) -> None:
        """Send nothing any more."""
        with self._wake:
            self._closed = True
            self._wake.notify()

    def _check_open(self):
        if self._closed:
            raise LinkLostError("the link is closed")

    def _run(self):
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._closed or self._commands or self._streams)
                if self._closed:
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
