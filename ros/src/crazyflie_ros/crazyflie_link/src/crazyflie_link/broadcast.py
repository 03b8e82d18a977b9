"""Packets to all vehicles of one radio channel at once; no vehicle acknowledges them."""

import logging
import math
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial

from cflib.crtp.crtpstack import CRTPPacket

from crazyflie_link.address import Address
from crazyflie_link.cflib_internals import RadioBroadcast, packet
from crazyflie_link.limits import REPEAT_PERIOD, REPEATS
from crazyflie_link.link import Link
from crazyflie_link.transmission import Transmission

#: Time limit from the first vehicle that is ready for a shared command to the last, s; after 0.2 s
#: without an answer each is sent its own command.
READY_TIME = 0.15

#: Bits of the header that belong to the link. Over UDP they are cleared in a broadcast packet.
_LINK_BITS = 3 << 2

_log = logging.getLogger(__name__)


def is_broadcast(sent: CRTPPacket) -> bool:
    """Return whether a packet over UDP is a copy for all vehicles."""
    return not sent.header & _LINK_BITS


class Broadcaster:
    """Sends to all vehicles of a radio's channel; over UDP, a copy to each of the links.

    The address is that of any vehicle of the channel; ``links()`` returns those of the vehicles
    that are connected. Commands are sent ``repeats`` times, ``period`` (s) after each other.
    """

    def __init__(
        self,
        address: Address,
        links: Callable[[], Iterable[Link]],
        repeats: int = REPEATS,
        period: float = REPEAT_PERIOD,
    ):
        self._links = links
        self._repeats, self._period = repeats, period
        self._radio = RadioBroadcast(address.uri) if address.is_radio else None
        self._queue = Transmission()
        self.sent = 0  #: Packets that were broadcast.

    def send(
        self, packets: Sequence[CRTPPacket], urgent: bool = False, end: float = math.inf
    ) -> None:
        """Queue packets to be sent repeatedly until a time (s, monotonic); does not block.

        Urgent packets go before all others. A failure is only logged: the caller has to check every
        vehicle afterwards in any case.
        """
        self._queue.put(partial(self._repeat, packets, end), urgent)

    def put_latest(self, stream: str, make: Callable[[], Sequence[CRTPPacket]]) -> None:
        """Queue the packets, if any, that ``make()`` will return; see `Transmission.put_latest`."""

        def send() -> None:
            if packets := make():
                self._transmit(packets)

        self._queue.put_latest(stream, send)

    def close(self) -> None:
        """Stop sending."""
        self._queue.close()
        if self._radio is not None:
            self._radio.close()

    def _repeat(self, packets, end):
        for number in range(self._repeats):
            if number:
                time.sleep(self._period)
            if time.monotonic() > end:
                _log.warning("a broadcast came too late, %d of %d sent", number, self._repeats)
                return
            self._transmit(packets)

    def _transmit(self, packets):
        if self._radio is not None:
            try:
                self._radio.transmit([bytes([each.header, *each.data]) for each in packets])
            except OSError as error:
                _log.warning("a broadcast could not be sent: %s", error)
                return
        else:
            for each in packets:
                marked = packet(each.port, each.channel, each.data)
                marked.header &= ~_LINK_BITS
                for link in self._links():
                    link.cflib.send_packet(marked)
        self.sent += len(packets)


class SharedCommand:
    """A command to several vehicles that is sent once, when each can receive its answer.

    If one of them does not become ready, nothing is sent: each repeats its own command.
    """

    def __init__(self, broadcaster: Broadcaster, vehicles: int):
        self._broadcaster = broadcaster
        self._awaited = vehicles
        self._end: float | None = None
        self._lock = threading.Lock()

    def ready(self, command: CRTPPacket) -> None:
        """Count one more vehicle as ready for the command; the last one has it sent to all."""
        with self._lock:
            now = time.monotonic()
            if self._end is None:
                self._end = now + READY_TIME
            self._awaited -= 1
            if self._awaited == 0 and now < self._end:
                # Later than that, each vehicle has received its own command, and would obey twice.
                self._broadcaster.send([command], end=self._end)
