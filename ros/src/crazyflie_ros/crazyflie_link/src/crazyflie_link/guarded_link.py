"""A link over which packets go only while something holds."""

from collections.abc import Callable
from typing import Any

from crazyflie_link.backend import packet
from crazyflie_link.exchange import Request
from crazyflie_link.link import Link
from crazyflie_link.outbox import Send

MaySend = Callable[[], bool]
"""Is called by the thread that sends, right before each packet: whether it is sent. Of two packets
that wait, the second cannot overtake the first between this call and the sending."""


class GuardedLink:
    """A `Link` whose commands and requests are sent only if ``may_send()``.

    A request that is held back ends as one that is not answered does.

    Parameters
    ----------
    link : Link
    may_send : MaySend
    """

    def __init__(self, link: Link, may_send: MaySend):
        self._link = link
        self._may_send = may_send

    def __getattr__(self, name: str) -> Any:
        """Return what is the link's."""
        return getattr(self._link, name)

    def command(self, send: Send, urgent: bool = False) -> None:
        """See `Link.command`."""
        self._link.command(self._guarded(send), urgent)

    def ask(self, send: Send | bytes, request: Request) -> bytes:
        """See `Link.ask`."""
        if isinstance(send, bytes):
            data = packet(request.port, request.channel, send)
            return self._link.ask(self._guarded(lambda: self.cflib.send_packet(data)), request)
        return self._link.ask(self._guarded(send), request)

    def _guarded(self, send):
        def transmit():
            if self._may_send():
                send()

        return transmit
