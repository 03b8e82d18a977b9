"""Notices when two nodes publish controls on one topic."""

import math
from collections import deque

#: A node that takes the place of one that sent less than this before, s, overlaps with it.
OVERLAP = 0.5
MEMORY = 5.0  #: An overlap is forgotten after this, s.


class Callers:
    """The nodes that publish on one topic: ``what``, in plural.

    A node that ends and another one that takes its place, or the same that is started again, are no
    two publishers: only changes count at which the former one has sent a moment before. So many of
    them as ``tolerance`` within `MEMORY` are a handover.
    """

    def __init__(self, what: str, tolerance: int):
        self._what = what
        self._tolerance = tolerance
        self._now = -math.inf
        self._last: tuple[str, float] | None = None
        self._former = ""
        self._changes: deque[float] = deque(maxlen=tolerance + 1)

    def note(self, time: float, caller: str, overlap: float = OVERLAP) -> None:
        """Take a message that a node has sent at ``time`` (s); without a name, one of this process.

        For ``overlap``, s, see `OVERLAP`.
        """
        self.advance(time)
        if self._last is not None and caller != self._last[0]:
            self._former, sent = self._last
            if time - sent < overlap:
                self._changes.append(time)
        self._last = (caller, time)

    def advance(self, time: float) -> None:
        """Let time pass until ``time`` (s)."""
        if time < self._now:
            # The clock was reset.
            self._changes.clear()
            self._last = None if self._last is None else (self._last[0], time)
        self._now = time
        while self._changes and time - self._changes[0] > MEMORY:
            self._changes.popleft()

    @property
    def complaint(self) -> str:
        """In words, that there are two; empty if there are not."""
        if self._last is None or len(self._changes) <= self._tolerance:
            return ""
        names = sorted(each or "one of this process" for each in (self._former, self._last[0]))
        return f"two nodes publish {self._what}, {' and '.join(names)}; expected one"
