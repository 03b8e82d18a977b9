"""Fixtures of the tests: a vehicle with scripted answers, and a cache of one's own."""

import pytest

from crazyflie_utils.testing.fixtures import own_cache, time_limit  # noqa: F401
from crazyflie_virtual.testing import READ_ONLY, FakeVehicle

LOG = {"stateEstimate.x": ("f", 1.5), "pm.vbat": ("f", 3.75), "radio.rssi": ("B", 47)}

PARAMETERS = {
    "ring.effect": ("B", 6, 0),
    "motor.trim": ("b", -3, 0),
    "cpu.id0": ("I", 2**32 - 1, READ_ONLY),
    "pid_rate.roll_kp": ("f", 0.1, 0),
}


@pytest.fixture
def vehicle():
    with FakeVehicle(log=dict(LOG), parameters=dict(PARAMETERS)) as vehicle:
        yield vehicle
