"""Who publishes controls, and the pauses of this process: knowledge about messages, not motion."""

import math
from collections import deque

from crazyflie_takeoff.envelope import LONG_PAUSE

OVERLAP = 0.5  #: Time after a message of one node in which one of another node is contention (s).
MEMORY = 5.0  #: Time after which a change of the node is forgotten (s).

LONGEST_PAUSE = 1.0  #: Longest pause (s): if the clock steps further, it was set.
PAUSE_MEMORY = 2.0  #: Time constant with which a pause is forgotten (s).
#: Fraction of the time, averaged over `STARVATION_MEMORY` (s), which a filter that can control a
#: flight may spend in long pauses.
STARVED_SHARE, STARVATION_MEMORY = 0.5, 3.0


class Publishers:
    """The nodes that publish on one topic, whose messages are called ``what``.

    A node that takes the place of another one, or is started again, is not a second publisher: a
    change is contention only if the former node has sent within `OVERLAP`. Up to ``tolerance``
    changes within `MEMORY` are a handover.
    """

    def __init__(self, what: str, tolerance: int):
        self.complaint = ""  #: Message that two nodes publish; empty if they do not.
        self._what = what
        self._tolerance = tolerance
        self._now = -math.inf
        self._last: tuple[str, float] | None = None
        self._former = ""
        self._changes: deque[float] = deque(maxlen=tolerance + 1)

    def note(self, now: float, name: str, overlap: float = OVERLAP) -> None:
        """Record a message of the node ``name`` (empty: of this process) at ``now`` (s).

        For ``overlap`` (s) see `OVERLAP`.
        """
        self.advance(now)
        if self._last is not None and name != self._last[0]:
            self._former, sent = self._last
            if now - sent < overlap:
                self._changes.append(now)
        self._last = (name, now)
        self._update_complaint()

    def renew(self, now: float) -> None:
        """Record another message of the last node at ``now`` (s)."""
        if self._last is not None:
            self._last = (self._last[0], now)

    def advance(self, now: float) -> None:
        """Advance to ``now`` (s)."""
        if now < self._now:
            # The clock was reset.
            self._changes.clear()
            self._last = None if self._last is None else (self._last[0], now)
        self._now = now
        if self._changes or self.complaint:
            while self._changes and now - self._changes[0] > MEMORY:
                self._changes.popleft()
            self._update_complaint()

    def _update_complaint(self):
        if self._last is None or len(self._changes) <= self._tolerance:
            self.complaint = ""
            return
        names = sorted(each or "one of this process" for each in (self._former, self._last[0]))
        self.complaint = f"two nodes publish {self._what}, {' and '.join(names)}; expected one"


class Pauses:
    """Pauses in which this process does not run, as on a computer that is too busy."""

    def __init__(self) -> None:
        self.longest = 0.0  #: Longest pause of the last seconds (s).
        self._lost = 0.0

    @property
    def complaint(self) -> str:
        """Message that the process runs too seldom for a flight; empty if it does not."""
        is_starved = self._lost > STARVED_SHARE
        return "this computer is too busy for a flight" if is_starved else ""

    def note(self, elapsed: float, longest: float) -> None:
        """Record that ``elapsed`` s have passed, with pauses of at most ``longest`` s."""
        remembered = self.longest * math.exp(-elapsed / PAUSE_MEMORY)
        pause = min(longest, LONGEST_PAUSE)
        self.longest = max(remembered, pause)
        share = 1.0 - math.exp(-min(elapsed, LONGEST_PAUSE) / STARVATION_MEMORY)
        self._lost += share * (float(pause > LONG_PAUSE) - self._lost)
