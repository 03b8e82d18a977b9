"""The charge by a voltage."""

import math

import pytest

from crazyflie_driver.monitors import BatteryMonitor, Charge


@pytest.fixture
def battery():
    return BatteryMonitor(low=3.2, critical=3.0, critical_time=5.0)


def test_low_is_reported_at_once(battery):
    assert battery.charge is Charge.UNKNOWN
    assert battery.update(3.7, 0.0) is Charge.GOOD
    assert battery.words() == ""
    assert battery.update(3.19, 0.1) is Charge.LOW
    assert battery.words() == "battery low: 3.19 V"
    assert battery.update(3.3, 0.2) is Charge.GOOD


def test_critical_needs_its_time(battery):
    assert [battery.update(2.9, t) for t in (0.0, 4.9)] == [Charge.LOW] * 2
    assert battery.update(3.05, 5.0) is Charge.LOW
    assert [battery.update(2.9, t) for t in (5.1, 10.0, 10.1)] == [
        Charge.LOW,
        Charge.LOW,
        Charge.CRITICAL,
    ]
    assert battery.words() == "battery critical: 2.90 V"
    assert battery.update(3.8, 10.2) is Charge.GOOD


def test_what_is_no_number_is_not_critical(battery):
    assert battery.update(math.nan, 0.0) is Charge.GOOD
    assert battery.update(math.nan, 10.0) is Charge.GOOD


def test_what_comes_back_with_less_load_is_critical_still(battery):
    for moment in (0.0, 5.0):
        battery.update(2.9, moment)
    assert [battery.update(volts, 6.0) for volts in (3.05, 3.19, 3.2)] == [
        Charge.CRITICAL,
        Charge.CRITICAL,
        Charge.GOOD,
    ]
