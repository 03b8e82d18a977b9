"""One connection to a vehicle, from its set-up to its end.

cflib never notices a vehicle that is frozen: a UDP socket stays open, and a radio's answers
come from a second processor. So a link is lost when neither a log packet nor the answer to a ping
has come for a while. Firmware that restarts within that time answers pings, but has lost its log
blocks: so log data must also come.
"""

import copy
import enum
import struct
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Self

from cflib.crazyflie.link_statistics import ECHO_CHANNEL
from cflib.crazyflie.log import CHAN_LOGDATA
from cflib.crazyflie.param import MISC_CHANNEL, READ_CHANNEL
from cflib.crazyflie.toc import CMD_TOC_INFO_V2, CMD_TOC_ITEM_V2, TOC_CHANNEL
from cflib.crtp.crtpstack import CRTPPacket, CRTPPort

from crazyflie_link.address import Address
from crazyflie_link.cflib_internals import (
    SafeCrazyflie,
    forget_dead_radios,
    init_drivers,
    lacks_safelink,
    packet,
)
from crazyflie_link.errors import (
    UNANSWERED,
    CrazyflieError,
    LinkLostError,
    NoAnswerError,
    NoSafelinkError,
    SetupError,
    ValueRangeError,
    explain,
)
from crazyflie_link.transmission import MaySend, Request, Send, Transmission

LOG_DATA = (CRTPPort.LOGGING, CHAN_LOGDATA)  #: Port and channel of log data.

#: Port and channel of packets that the radio chip sends by itself, without the main processor.
_NULL = (CRTPPort.LINKCTRL, 3)
_PING = (CRTPPort.LINKCTRL, ECHO_CHANNEL)
_SOURCE_PERIOD, _CHECK_PERIOD = 0.1, 0.05

OnPacket = Callable[[int, int, bytes], None]  #: Is called with port, channel and data.

#: Age of the last packet, in s, at which a link is lost; noticed before 0.5 s, when the firmware
#: gives up on a setpoint.
LOST_AFTER = 0.45

_PERIODS_MISSED = 4  #: Number of consecutive log packets that may be missing.
_HEARD_FOR = 0.25  #: After a silence log data may come a little later than answers to pings, s.
_WINDOW = 20  #: Number of pings for the link quality; cflib sends 10 a second.
_LATEST, _FEW = 5, 3  #: Fraction of answered pings below which a link is poor.

OLDEST_PROTOCOL = 4  #: First version of the protocol with tables of more than 255 items.

_TABLES = {CRTPPort.LOGGING: "log table", CRTPPort.PARAM: "parameter table"}
#: Steps whose packets are not counted: each is progress.
_UNNUMBERED = _MEMORIES, _TYPES = "list of memories", "parameter types"


@dataclass(frozen=True)
class LinkTimeouts:
    """Time limits of a connection, s.

    The first answer is the time from opening the link to the first packet; stall that without
    progress, while tables and parameter values are read; total that of the whole set-up. A link is
    lost when the last packet is older than ``lost``.
    """

    first_answer: float = 2.0
    stall: float = 1.5
    total: float = 30.0
    lost: float = LOST_AFTER


class LinkSetup:
    """The present step of a connection's set-up, by the packets that arrive."""

    def __init__(self, uri: str, limits: LinkTimeouts):
        self._uri = uri
        self._limits = limits
        self._step = "waiting for the first answer"
        self._sizes: dict[int, int] = {}
        self._values: set[bytes] = set()
        self._has_answered = False
        self.begin()

    def begin(self) -> None:
        """Start the time limits."""
        self._begin = self._progress_time = time.monotonic()

    def receive(self, port: int, channel: int, data: bytes) -> None:
        """Follow the progress by a packet from the vehicle."""
        step = self._step_of(port, channel, data)
        if step in _UNNUMBERED or step not in (None, self._step) or not self._has_answered:
            self._progress_time = time.monotonic()
        self._step = step or self._step
        self._has_answered = True

    def check(self, protocol: int) -> None:
        """Raise `NoAnswerError` or `SetupError` if the set-up cannot succeed any more.

        The protocol is negative while it is not known.
        """
        now, limits = time.monotonic(), self._limits
        if 0 <= protocol < OLDEST_PROTOCOL:
            raise SetupError(
                f"{self._uri}: the firmware speaks protocol {protocol}, at least "
                f"{OLDEST_PROTOCOL} is needed: update the firmware"
            )
        if not self._has_answered:
            if now - self._begin > limits.first_answer:
                raise NoAnswerError(
                    f"{self._uri}: no answer has come within {limits.first_answer:g} s, although "
                    "the address can be reached: is it a Crazyflie, is it on, and is no other "
                    "program connected to it?"
                )
        elif now - self._progress_time > limits.stall:
            raise SetupError(
                f"{self._uri}: the vehicle answers, but the connection is stuck ({self._step}) "
                f"for {limits.stall:g} s: restart the vehicle, come nearer or try another channel"
            )
        elif now - self._begin > limits.total:
            raise SetupError(
                f"{self._uri}: not connected after {limits.total:g} s ({self._step}): the link "
                "is too slow; try another channel or a higher data rate"
            )

    def _step_of(self, port, channel, data):
        # Returns None for a packet that belongs to no step.
        size = self._sizes.get(port, 0)
        if port == CRTPPort.MEM:
            return _MEMORIES
        if (port, channel) == (CRTPPort.PARAM, MISC_CHANNEL):
            return _TYPES
        if (port, channel) == (CRTPPort.PARAM, READ_CHANNEL):
            # A repeated value is not progress.
            self._values.add(bytes(data[:2]))
            return f"parameter values, {len(self._values)} of {size}"
        if channel == TOC_CHANNEL and port in _TABLES and len(data) > 2:
            (number,) = struct.unpack_from("<H", data, 1)
            if data[0] == CMD_TOC_INFO_V2:
                self._sizes[port] = number
                return f"{_TABLES[port]} of {number} items"
            if data[0] == CMD_TOC_ITEM_V2:
                return f"{_TABLES[port]}, item {number + 1} of {size}"
        return None


class LinkHealth(enum.Enum):
    """State of a link, judged by the packets that arrive."""

    ALIVE = "alive"
    SILENT = "silent"
    RESTARTED = "restarted"
    ENDED = "ended"


class LinkMonitor:
    """The age of the last packet, and how many pings were answered.

    All times are in s, of one steady clock. It is alive at first, and lost when its last packet is
    older than the limit.
    """

    def __init__(self, now: float, limit: float = LOST_AFTER):
        self._limit = limit
        self._received = now
        self._heard_since = now
        self._logged = now
        self._log_limit: float | None = None
        self._checked = now
        self._lock = threading.Lock()
        self._pings: dict[bytes, bool] = {}

    def received(self, now: float) -> None:
        """Record a packet that shows that the vehicle is alive."""
        if now - self._received > self._limit:
            self._heard_since = now
        self._received = now

    def log_received(self, now: float) -> None:
        """Record a log packet."""
        self.received(now)
        self._logged = now

    def expect_log(self, period: float, now: float) -> None:
        """Expect log packets with a period (s) from now on."""
        limit = max(self._limit, _PERIODS_MISSED * period)
        self._log_limit = limit if self._log_limit is None else min(limit, self._log_limit)
        self._logged = max(self._logged, now)

    def ping_sent(self, content: bytes) -> None:
        """Record a ping that was sent."""
        with self._lock:
            # The thread that receives answers may be faster than the one that has sent.
            self._pings.setdefault(content, False)
            while len(self._pings) > _WINDOW:
                del self._pings[next(iter(self._pings))]

    def ping_answered(self, content: bytes, now: float) -> None:
        """Record the answer to a ping, which is its echo."""
        self.received(now)
        with self._lock:
            self._pings[content] = True

    def age(self, now: float) -> float:
        """Return the age of the last such packet, s."""
        return max(0.0, now - self._received)

    def quality(self) -> float:
        """Return the share of the latest pings that were answered, 0 to 1.

        The latest ping is not included: its answer may be under way.
        """
        with self._lock:
            pings = list(self._pings.values())[:-1]
        return sum(pings) / len(pings) if pings else 1.0

    def is_poor(self) -> bool:
        """Return whether hardly any of the latest pings were answered."""
        with self._lock:
            pings = list(self._pings.values())[-_LATEST - 1 : -1]
        return len(pings) == _LATEST and sum(pings) <= _FEW

    def state(self, now: float) -> LinkHealth:
        """Return the state of the link by its packets; to be called several times within the limit.

        When this call itself comes late, the machine was busy, and packets may not have been read
        yet: the vehicle gets a new period.
        """
        late = now - self._checked > 0.5 * self._limit
        self._checked = now
        if late:
            self._received = max(self._received, now - 0.5 * self._limit)
            self._logged = max(self._logged, now - 0.5 * self._limit)
        if self.age(now) > self._limit:
            return LinkHealth.SILENT
        if self._log_limit is None or now - self._logged <= self._log_limit:
            return LinkHealth.ALIVE
        # The answer to a ping may have come just after the last log packet; both are missing then.
        if self._received - self._logged < 0.5 * self._log_limit:
            return LinkHealth.ALIVE
        # Until log data also come, the state is not known.
        return LinkHealth.RESTARTED if now - self._heard_since > _HEARD_FOR else LinkHealth.SILENT


class Link:
    """A connection that is opened once and closed once.

    The cache is the folder of the tables; ``on_packet(port, channel, data)`` is called for every
    packet, in cflib's thread. With ``needs_safelink`` a radio link without numbered packets is not
    set up: see `lacks_safelink`. For ``put``, ``put_latest`` and ``discard`` see `Transmission`.
    """

    def __init__(
        self,
        address: Address,
        limits: LinkTimeouts | None = None,
        cache: str | None = None,
        on_packet: OnPacket | None = None,
        needs_safelink: bool = False,
    ):
        self.address = address
        self._needs_safelink = needs_safelink
        self._limits = limits or LinkTimeouts()
        self._on_packet = on_packet
        self._setup = LinkSetup(address.uri, self._limits)
        #: Age of the vehicle's packets, since the link was set up.
        self.monitor = LinkMonitor(time.monotonic(), self._limits.lost)
        self.error: CrazyflieError | None = None  #: Why the link has ended; None while it is open.
        self._lock = threading.Lock()
        self._complete = threading.Event()
        self._radio_error = ""
        self._is_closed = False
        self._transmission = Transmission()
        self.put = self._transmission.put
        self.put_latest = self._transmission.put_latest
        self.discard = self._transmission.discard
        self.cflib = SafeCrazyflie(cache, self._fail)
        self.cflib.packet_received.add_callback(self._on_received)
        self.cflib.packet_sent.add_callback(self._on_sent)
        self.cflib.connected.add_callback(self._on_connected)
        self.cflib.fully_connected.add_callback(self._on_complete)
        self.cflib.connection_failed.add_callback(lambda _, text: self._fail(text))

    # Set-up.

    def open(self) -> None:
        """Connect: find the vehicle, read its tables and parameters; blocks.

        Raises `CrazyflieError` with the reason and what to do, `NoSafelinkError` if another attempt
        helps at once; the link is closed then.
        """
        try:
            init_drivers()
            self._setup.begin()
            # A dongle that hangs, or the lookup of a host's name, may block.
            threading.Thread(target=self._open_cflib, name="crazyflie-open", daemon=True).start()
            asked = time.monotonic()
            while not self._complete.wait(_CHECK_PERIOD) or self.error is not None:
                if self.error is not None:
                    raise self.error
                self._setup.check(self.protocol)
                if self.protocol < 0 and time.monotonic() - asked > _SOURCE_PERIOD:
                    asked = time.monotonic()
                    self.put_latest("source", self.cflib.request_source)
        except BaseException as error:
            self.close(str(error))
            raise

    def _open_cflib(self):
        forget_dead_radios()
        self.cflib.open_link(self.address.uri)
        # `open` may have given up meanwhile.
        if self._is_closed:
            self.cflib.disconnect()

    def _on_connected(self, uri):
        self.monitor = LinkMonitor(time.monotonic(), self._limits.lost)
        # Without a single parameter cflib never reports that it is complete.
        if not self.cflib.param.toc.toc:
            self._on_complete(uri)

    def _on_complete(self, _):
        self._complete.set()

    # Operation.

    @property
    def protocol(self) -> int:
        """Version of the protocol that the vehicle speaks; negative while it is not known."""
        return self.cflib.platform.get_protocol_version()

    def health(self) -> tuple[LinkHealth, str]:
        """Return the health of the link by the vehicle's packets, and the same in words."""
        if self.error is not None:
            return LinkHealth.ENDED, str(self.error)
        state = self.monitor.state(time.monotonic())
        if state is LinkHealth.ALIVE:
            return state, "connected"
        if state is LinkHealth.RESTARTED:
            text = "the log data have stopped although the vehicle answers: has it restarted?"
        else:
            text = f"the vehicle has not been heard for {self._limits.lost:g} s{self._radio_error}"
        return state, f"{self.address.uri}: {text}"

    def send(self, port: int, channel: int, data: bytes) -> None:
        """Send a packet with at most 30 bytes of data."""
        most = CRTPPacket.MAX_DATA_SIZE
        if not (0 <= port <= 15 and 0 <= channel <= 3 and len(data) <= most):
            raise ValueRangeError(
                f"no packet: port {port} (0 to 15), channel {channel} (0 to 3), {len(data)} bytes "
                f"(at most {most})"
            )
        self.put(partial(self.cflib.send_packet, packet(port, channel, data)))

    def request(self, send: Send | bytes, request: Request) -> bytes:
        """Send a request and return the data of its answer; see `Transmission.request`.

        ``send`` is a call, or data for the port and channel of the answer.
        """
        transmit = (
            partial(self.cflib.send_packet, packet(request.port, request.channel, send))
            if isinstance(send, bytes)
            else send
        )
        return self._transmission.request(transmit, request, self.put)

    def guarded(self, may_send: MaySend) -> Self:
        """Return the same open link, whose commands and requests go out only if ``may_send()``.

        A request that is held back ends like an unanswered one.
        """
        guarded, put = copy.copy(self), self.put

        def put_guarded(send: Send, urgent: bool = False) -> None:
            put(lambda: send() if may_send() else None, urgent)

        guarded.put = put_guarded
        return guarded

    # End.

    def close(self, reason: str = "the link was closed") -> None:
        """End the connection, once; pending requests fail with the reason."""
        with self._lock:
            if self._is_closed:
                return
            self._is_closed = True
            self.error = self.error or LinkLostError(reason)
        self._transmission.close(reason)
        self.cflib.disconnect()

    def _fail(self, text):
        with self._lock:
            if self.error is not None:
                return
            cause = explain(self.address.uri, text)
            if self._complete.is_set() and UNANSWERED in text.lower():
                # The driver continues, and the vehicle may be heard again.
                self._radio_error = f" ({cause})"
            elif self.cflib.is_connected():
                self.error = LinkLostError(f"the link was lost: {cause}")
            else:
                self.error = cause

    def _check_safelink(self):
        if self._needs_safelink and lacks_safelink(self.cflib.link):
            with self._lock:
                self.error = self.error or NoSafelinkError(f"{self.address.uri}: no safelink")

    # cflib's thread goes on after an exception in here.

    def _on_received(self, received):
        self._radio_error = ""
        port, channel, data = received.port, received.channel, bytes(received.data)
        if not self._complete.is_set():
            self._check_safelink()
            # Of a vehicle that starts, the radio chip is heard before.
            if (port, channel) != _NULL:
                self._setup.receive(port, channel, data)
        if (port, channel) == LOG_DATA:
            self.monitor.log_received(time.monotonic())
        elif (port, channel) == _PING:
            self.monitor.ping_answered(data, time.monotonic())
        self._transmission.receive(port, channel, data)
        if self._on_packet is not None:
            self._on_packet(port, channel, data)

    def _on_sent(self, sent):
        if (sent.port, sent.channel) == _PING:
            self.monitor.ping_sent(bytes(sent.data))
