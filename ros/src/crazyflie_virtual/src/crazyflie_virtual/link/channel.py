"""One direction of the link, with its faults."""

import math
from collections import deque
from random import Random

from crazyflie_virtual.faults import FaultSwitches
from crazyflie_virtual.server import Address

Item = tuple[bytes, Address]  #: Datagram, and its sender or receiver.


class Channel:
    """Datagrams on their way; ``random`` decides which are lost."""

    def __init__(self, faults: FaultSwitches, random: Random):
        self._faults = faults
        self._random = random
        self._on_the_way: deque[tuple[float, Item]] = deque()

    def push(self, time: float, item: Item) -> None:
        """Send something at ``time`` (s)."""
        faults = self._faults
        if faults.silence > 0.0 or self._random.random() < faults.loss:
            return
        due = time + max(faults.delay, 0.0)
        if self._on_the_way:
            # Nothing overtakes, also when the delay has become shorter.
            due = max(due, self._on_the_way[-1][0])
        self._on_the_way.append((due, item))

    def pop(self, time: float) -> list[Item]:
        """Return what has arrived at ``time`` (s), oldest first."""
        arrived = []
        while self._on_the_way and self._on_the_way[0][0] <= time:
            arrived.append(self._on_the_way.popleft()[1])
        return [] if self._faults.silence > 0.0 else arrived

    def next_arrival(self) -> float:
        """Return when the next one arrives, s; infinity when there is none."""
        return self._on_the_way[0][0] if self._on_the_way else math.inf
