"""Whether a connection is being set up in time, and whether the vehicle is still there afterwards.

cflib never notices a vehicle that is frozen: a UDP socket stays open, and a radio's answers
come from a second processor. So a link is lost when neither a log packet nor the answer to a ping
has come for a while. Firmware that restarts within that time answers pings, but has forgotten its
log blocks: so log data have to come as well.
"""

import enum
import struct
import threading
import time
from dataclasses import dataclass

from cflib.crazyflie.param import MISC_CHANNEL, READ_CHANNEL
from cflib.crazyflie.toc import CMD_TOC_INFO_V2, CMD_TOC_ITEM_V2, TOC_CHANNEL
from cflib.crtp.crtpstack import CRTPPort

from crazyflie_link.errors import NoAnswerError, SetupError

#: Age of the last packet, in s, at which a link is lost; noticed before 0.5 s, when the firmware
#: gives up on a setpoint.
LOST_AFTER = 0.45

_PERIODS_MISSED = 4  #: Number of consecutive log packets that may be missing.
_HEARD_FOR = 0.25  #: After a silence log data may come a little later than answers to pings, s.
_WINDOW = 20  #: Pings that the link quality is computed from; cflib sends 10 a second.
_LATEST, _FEW = 5, 3  #: A link is poor when so few of the latest pings have been answered.


class LinkHealth(enum.Enum):
    """State of a link, judged by the packets that arrive."""

    ALIVE = "alive"
    SILENT = "silent"
    RESTARTED = "restarted"


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

        The very latest is left out: its answer may be under way.
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
        """Return what the packets show; to be called several times within the limit.

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
        # Until its log data come, too, that is not known.
        return LinkHealth.RESTARTED if now - self._heard_since > _HEARD_FOR else LinkHealth.SILENT


OLDEST_PROTOCOL = 4  #: The first protocol version with tables of more than 255 items.

_TABLES = {CRTPPort.LOGGING: "log table", CRTPPort.PARAM: "parameter table"}


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
        if self._advances(port, channel, data) or not self._has_answered:
            self._progress_time = time.monotonic()
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

    def _advances(self, port, channel, data):
        if channel == TOC_CHANNEL and port in _TABLES and data:
            return self._read_table(port, data)
        if port == CRTPPort.MEM:
            self._step = "list of memories"
            return True
        if (port, channel) == (CRTPPort.PARAM, READ_CHANNEL):
            # A value that comes again is no progress.
            known = len(self._values)
            self._values.add(bytes(data[:2]))
            total = self._sizes.get(port, 0)
            self._step = f"parameter values, {len(self._values)} of {total}"
            return len(self._values) > known
        if (port, channel) == (CRTPPort.PARAM, MISC_CHANNEL):
            self._step = "parameter types"
            return True
        return False

    def _read_table(self, port, data):
        if len(data) < 3 or data[0] not in (CMD_TOC_INFO_V2, CMD_TOC_ITEM_V2):
            return False
        (number,) = struct.unpack_from("<H", data, 1)
        before, size = self._step, self._sizes.get(port, 0)
        if data[0] == CMD_TOC_INFO_V2:
            self._sizes[port] = number
            self._step = f"{_TABLES[port]} of {number} items"
        else:
            self._step = f"{_TABLES[port]}, item {number + 1} of {size}"
        return self._step != before
