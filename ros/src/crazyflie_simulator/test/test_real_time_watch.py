"""Ticks that often come late are reported, once in a while; a few are not."""

import pytest

from crazyflie_simulator.simulator_node import LATE_TICKS, LATENESS, RealTimeWatch

PERIOD = 0.01


class Handle:
    """A clock, and the warnings."""

    def __init__(self):
        self.now = 100.0
        self.warnings = []

    def time(self):
        return self.now

    def warn(self, text, **_):
        self.warnings.append(text)


@pytest.mark.parametrize(
    ("late", "between", "count"),
    [
        (PERIOD + LATENESS + 0.01, 0.5, 1),
        (PERIOD + LATENESS - 0.01, 0.5, 0),
        (PERIOD + LATENESS + 0.01, 5.0, 0),
    ],
)
def test_many_late_ticks_in_a_short_time_are_reported(late, between, count):
    handle = Handle()
    watch = RealTimeWatch(handle)
    watch.tick(PERIOD)
    for _ in range(LATE_TICKS):
        handle.now += late
        watch.tick(PERIOD)
        for _ in range(round(between / PERIOD)):
            handle.now += PERIOD
            watch.tick(PERIOD)
    assert len(handle.warnings) == count
    assert all("too busy" in text and "sim_time:=true" in text for text in handle.warnings)
