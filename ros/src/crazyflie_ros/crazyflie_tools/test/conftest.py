"""Fixtures of the tests: a vehicle that answers as it is told to, and a cache of one's own."""

import faulthandler

import pytest

from crazyflie_dev.fake_vehicle import READ_ONLY, FakeVehicle

LOG = {"stateEstimate.x": ("f", 1.5), "pm.vbat": ("f", 3.75), "radio.rssi": ("B", 47)}

PARAMETERS = {
    "ring.effect": ("B", 6, 0),
    "motor.trim": ("b", -3, 0),
    "cpu.id0": ("I", 2**32 - 1, READ_ONLY),
    "pid_rate.roll_kp": ("f", 0.1, 0),
}


@pytest.fixture(autouse=True)
def _own_cache(monkeypatch, tmp_path_factory):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))


@pytest.fixture(autouse=True)
def _limit():
    """End the tests when one hangs."""
    faulthandler.dump_traceback_later(120.0, exit=True)
    yield
    faulthandler.cancel_dump_traceback_later()


@pytest.fixture
def vehicle():
    with FakeVehicle(log=dict(LOG), parameters=dict(PARAMETERS)) as vehicle:
        yield vehicle
