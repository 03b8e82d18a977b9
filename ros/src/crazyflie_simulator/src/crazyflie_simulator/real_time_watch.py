"""Notices that a computer is too busy to simulate in real time."""

import math
from collections import deque

from crazyflie_utils import NodeHandle

LATENESS = 0.1
"""A tick that comes later than this is late, s: poses of the time before are left out."""

LATE_TICKS, WINDOW = 5, 10.0
"""So many late ticks within so many seconds are reported."""


class RealTimeWatch:
    """Warns when ticks of a timer in real time often come late."""

    def __init__(self, handle: NodeHandle):
        self._handle = handle
        self._last = math.inf
        self._late: deque[float] = deque(maxlen=LATE_TICKS)

    def tick(self, period: float) -> None:
        """Note a tick that was due ``period`` (s) after the one before."""
        now = self._handle.time()
        interval, self._last = now - self._last, now
        if interval <= period + LATENESS:
            return
        self._late.append(now)
        if len(self._late) == LATE_TICKS and now - self._late[0] < WINDOW:
            self._handle.warn(
                f"this computer is too busy: {LATE_TICKS} times in {now - self._late[0]:.1f} s the "
                f"simulator had to wait more than {LATENESS:g} s. The flight will not be as it "
                "should; with sim_time:=true real_time_factor:=0 it does not depend on that",
                throttle=WINDOW,
                key="busy",
            )
