"""A fake process in which fleets of missions fly, as fast as possible."""

from crazyflie_mission_api import fleet
from crazyflie_utils.testing import FakeProcess


class FakeClock:
    """Time that passes during waits."""

    def __init__(self, handle, has_ended):
        self._process = handle._process

    def time(self):
        return self._process.clock.time()

    def wait_until(self, condition, deadline):
        while not (is_met := condition()) and self.time() < deadline:
            self._process.advance(0.05)
        return is_met


def fake_process(monkeypatch):
    """Return a process in which a `Fleet` finds vehicles."""
    monkeypatch.setattr(fleet, "RosClock", FakeClock)
    monkeypatch.setattr(fleet, "topic_types", lambda handle: {})
    # Messages of a mission arrive at once.
    monkeypatch.setattr(fleet, "mission_nodes", lambda handle: 0)
    process = FakeProcess()
    # A FakeProcess has started.
    monkeypatch.setattr(process, "start", lambda: process.advance(0.1))
    return process
