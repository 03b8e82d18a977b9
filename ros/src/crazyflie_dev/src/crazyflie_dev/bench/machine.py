"""What the machine alone does to a period: no figure can be better than that."""

import time

import numpy as np

from crazyflie_dev.bench.row import Row

PERIOD = 0.01  #: Of the loop, s: that of the controls.
COUNT = 500  #: How many periods are measured.


def _longest_periods():
    """Return the 99th percentile of the periods of a loop that only sleeps, ms."""
    due, moments = time.monotonic(), []
    for _ in range(COUNT):
        due += PERIOD
        time.sleep(max(due - time.monotonic(), 0.0))
        moments.append(time.monotonic())
    return float(np.percentile(np.diff(moments), 99)) * 1e3


ROWS = [Row("machine", "an empty loop of 10 ms, p99 of the period", "ms", _longest_periods)]
