"""Whether the vehicle is still there, which only its own packets show.

cflib never notices a vehicle that is frozen: a UDP socket stays open, and a
radio's acknowledgements come from a second processor. So a link counts as lost
when neither a log packet nor the answer to a ping has come for a while.
"""

import threading

LOST_AFTER = 0.5
"""Age of the last sign of life, in s, at which a link is lost: the firmware, too,
gives up on a setpoint after 500 ms."""

_WINDOW = 20
"""Pings that the link quality is computed from; cflib sends 10 a second."""


class Liveness:
    """The age of the last sign of life, and how many pings were answered.

    All times are in s, of one steady clock.

    Parameters
    ----------
    now : float
        The link is alive at this moment.
    limit : float
        Age of the last sign of life at which the link is lost, s.
    """

    def __init__(self, now: float, limit: float = LOST_AFTER):
        self._limit = limit
        self._received = now
        self._checked = now
        self._lock = threading.Lock()
        self._pings: dict[bytes, bool] = {}

    def received(self, now: float) -> None:
        """Take note of a sign of life."""
        self._received = now

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
        """Return the age of the last sign of life, s."""
        return max(0.0, now - self._received)

    def quality(self) -> float:
        """Return the share of the latest pings that were answered, 0 to 1.

        The very latest is left out: its answer may be under way.
        """
        with self._lock:
            pings = list(self._pings.values())[:-1]
        return sum(pings) / len(pings) if pings else 1.0

    def is_lost(self, now: float) -> bool:
        """Return whether the link is lost; to be called several times within the limit.

        When this call itself comes late, the machine was busy, and packets of the
        vehicle may wait to be read: it gets a new period.
        """
        late = now - self._checked > 0.5 * self._limit
        self._checked = now
        if late:
            self._received = max(self._received, now - 0.5 * self._limit)
        return self.age(now) > self._limit
