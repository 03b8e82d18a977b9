"""Whether the vehicle is still there, by its own packets.

cflib never notices a vehicle that is frozen: a UDP socket stays open, and a radio's answers
come from a second processor. So a link is lost when neither a log packet nor the answer to a ping
has come for a while. Firmware that restarts within that time answers pings, but knows no log blocks
any more: so the log data, too, have to come.
"""

import enum
import threading

#: Age of the last packet, in s, at which a link is lost; noticed before 0.5 s, when the firmware
#: gives up on a setpoint.
LOST_AFTER = 0.45

_PERIODS_MISSED = 4  #: Log packets that may be missing one after the other.
_HEARD_FOR = 0.25  #: After a silence log data may come a little later than answers to pings, s.
_WINDOW = 20  #: Pings that the link quality is computed from; cflib sends 10 a second.
_LATEST, _FEW = 5, 3  #: A link is poor when so few of the latest pings have been answered.
_TICKS = 1 << 24  #: The vehicle counts ms in 24 bits.

_REORDERED_MS = 100

#: How late the quickest packet may have come, ms: this machine may have been busy.
_LATEST_FIRST_MS = 60_000.0


class LinkHealth(enum.Enum):
    """What the packets show."""

    ALIVE = "alive"
    SILENT = "silent"
    RESTARTED = "restarted"


class Uptime:
    """The vehicle's clock, in log packets, which begins anew when the firmware restarts.

    Its 24 bits begin anew by themselves, too, every 4.66 h. It has restarted when it is ahead of
    this machine's, if it is taken to have gone on: packets come late, but never early.
    """

    def __init__(self) -> None:
        # The second last one was received, and its time with all bits.
        self._latest: tuple[int, float] | None = None
        self._late_ms = 0.0

    def has_restarted(self, time_ms: int, now: float) -> bool:
        """Return whether the clock (ms, 24 bits) has begun anew since the last call (s)."""
        if self._latest is None:
            self._latest = time_ms, now
            return False
        before_ms, before = self._latest
        elapsed_ms = 1000.0 * (now - before)
        if (before_ms - time_ms) % _TICKS <= _REORDERED_MS and elapsed_ms < _TICKS / 2:
            return False
        step_ms = (time_ms - before_ms) % _TICKS
        # After hours without a packet.
        step_ms += _TICKS * max(0, round((elapsed_ms - step_ms) / _TICKS))
        # How much later than the quickest packet this one came.
        late = self._late_ms + elapsed_ms - step_ms
        self._late_ms = max(0.0, late)
        has_restarted = late < -_LATEST_FIRST_MS
        self._latest = (time_ms if has_restarted else before_ms + step_ms), now
        return has_restarted

    def unwrapped(self, time_ms: int) -> int:
        """Return a time (ms, 24 bits) near the latest one with all its bits.

        It never jumps back while the vehicle is on; bits that it had before the first call are
        not known.
        """
        if self._latest is None:
            return time_ms
        ahead = (time_ms - self._latest[0] + _TICKS // 2) % _TICKS - _TICKS // 2
        return max(0, self._latest[0] + ahead)


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
        """Take note of a packet that shows that the vehicle is alive."""
        if now - self._received > self._limit:
            self._heard_since = now
        self._received = now

    def log_received(self, now: float) -> None:
        """Take note of a log packet."""
        self.received(now)
        self._logged = now

    def expect_log(self, period: float, now: float) -> None:
        """Take note that log packets are going to come with a period (s)."""
        limit = max(self._limit, _PERIODS_MISSED * period)
        self._log_limit = limit if self._log_limit is None else min(limit, self._log_limit)
        self._logged = max(self._logged, now)

    def ping_sent(self, content: bytes) -> None:
        """Take note of a ping that was sent."""
        with self._lock:
            # The thread that receives answers may be faster than the one that has sent.
            self._pings.setdefault(content, False)
            while len(self._pings) > _WINDOW:
                del self._pings[next(iter(self._pings))]

    def ping_answered(self, content: bytes, now: float) -> None:
        """Take note of the answer to a ping, which is its echo."""
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
