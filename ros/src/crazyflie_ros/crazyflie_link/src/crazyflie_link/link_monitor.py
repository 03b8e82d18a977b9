"""Checks whether the vehicle at the other end of a link still answers.

cflib never notices a vehicle that is frozen: a UDP socket stays open, and a radio's answers
come from a second processor. So a link is lost when neither a log packet nor the answer to a ping
has come for a while. Firmware that restarts within that time answers pings, but has lost its log
blocks: so log data must also come.
"""

import enum
import threading

#: Age of the last packet, in s, at which a link is lost; noticed before 0.5 s, when the firmware
#: gives up on a setpoint.
LOST_AFTER = 0.45

_PERIODS_MISSED = 4  #: Number of consecutive log packets that may be missing.
_HEARD_FOR = 0.25  #: After a silence log data may come a little later than answers to pings, s.
_WINDOW = 20  #: Number of pings for the link quality; cflib sends 10 a second.
_LATEST, _FEW = 5, 3  #: Fraction of answered pings below which a link is poor.


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
