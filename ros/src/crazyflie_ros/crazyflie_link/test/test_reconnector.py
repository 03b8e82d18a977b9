"""When a link is kept, and until when it is tried, with a clock that is moved by hand."""

from types import SimpleNamespace
from unittest.mock import patch

import pytest

from crazyflie_link import crazyflie as module
from crazyflie_link.crazyflie import Crazyflie, LinkState
from crazyflie_link.errors import (
    AddressError,
    LinkLostError,
    NoAnswerError,
    NoDongleError,
    SetupError,
)
from crazyflie_link.link import Link, LinkHealth
from crazyflie_link.supervisor import EmergencyStop


class Bench:
    """A vehicle that cannot be reached, its states, and a clock that waiting moves."""

    def __init__(self, monkeypatch):
        self.now, self.states = 5.0, []
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: self.now))
        self.vehicle = Crazyflie(
            "udp://here:1", True, lambda state, text: self.states.append(state), cache="/here"
        )
        self.vehicle._closed = SimpleNamespace(wait=self.wait, is_set=lambda: False)

    def wait(self, period):
        self.now += period
        return False


class Late(Bench):
    """A vehicle that answers from a time on, and counts the attempts to connect to it."""

    def __init__(self, monkeypatch, comes_after, error=NoAnswerError):
        super().__init__(monkeypatch)
        self.attempts, self._error = 0, error
        self._begin, self._end = self.now, self.now + comes_after
        self.vehicle._open = self.open
        monkeypatch.setattr(self.vehicle, "_watch", lambda: None)

    def open(self):
        self.attempts += 1
        if self.now < self._end:
            raise self._error("no answer")

    @property
    def waited(self):
        return self.now - self._begin


def test_a_vehicle_that_comes_5_s_later_is_waited_for(monkeypatch):
    bench = Late(monkeypatch, comes_after=5.0)
    bench.vehicle.connect(15.0)
    assert 5.0 <= bench.waited < 5.5
    assert bench.states[-3:] == [LinkState.DISCONNECTED, LinkState.CONNECTING, LinkState.CONNECTED]


def test_a_vehicle_that_does_not_come_is_given_up_after_the_limit(monkeypatch):
    bench = Late(monkeypatch, comes_after=100.0)
    with pytest.raises(NoAnswerError):
        bench.vehicle.connect(15.0)
    assert 15.0 <= bench.waited < 15.5
    assert bench.states[-1] is LinkState.DISCONNECTED


@pytest.mark.parametrize("error", [NoDongleError, AddressError, SetupError])
def test_what_waiting_does_not_mend_is_not_tried_again(monkeypatch, error):
    bench = Late(monkeypatch, 5.0, error)
    with pytest.raises(error):
        bench.vehicle.connect(15.0)
    assert bench.attempts == 1


def test_closing_ends_the_attempts(monkeypatch):
    bench = Late(monkeypatch, comes_after=5.0)
    bench.vehicle._closed.wait = lambda period: bench.wait(period) or bench.waited > 1.0
    with pytest.raises(NoAnswerError):
        bench.vehicle.connect(15.0)
    assert bench.waited < 1.5


def test_pauses_between_attempts_grow_up_to_five_seconds(monkeypatch):
    bench, pauses = Bench(monkeypatch), []

    def has_closed_within(pause):
        pauses.append(pause)
        return len(pauses) == 9

    bench.vehicle._has_closed_within = has_closed_within
    with patch("crazyflie_link.crazyflie.Link", spec=Link) as link_class:
        link_class.side_effect = LinkLostError("no vehicle")
        assert not bench.vehicle._connect_again()
    assert pauses == pytest.approx([0.0, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 5.0, 5.0])
    assert bench.states == [LinkState.LOST]


@pytest.mark.parametrize(("is_urgent", "end"), [(False, 6.0), (True, 5.05)])
def test_an_urgent_attempt_does_not_wait(monkeypatch, is_urgent, end):
    bench = Bench(monkeypatch)
    monkeypatch.setattr(EmergencyStop, "is_requested", is_urgent)
    assert not bench.vehicle._has_closed_within(1.0)
    assert bench.now == pytest.approx(end, abs=0.06)


def test_a_silent_link_is_kept_for_a_second(monkeypatch):
    bench = Bench(monkeypatch)
    is_usable = bench.vehicle._is_usable
    assert is_usable(LinkHealth.ALIVE, "")
    assert bench.states == []
    assert is_usable(LinkHealth.SILENT, "silent")
    bench.now += 0.9
    assert is_usable(LinkHealth.SILENT, "silent")
    assert is_usable(LinkHealth.ALIVE, "")
    assert bench.states == [LinkState.LOST, LinkState.CONNECTED]
    assert is_usable(LinkHealth.SILENT, "silent")
    bench.now += 1.1
    assert not is_usable(LinkHealth.SILENT, "silent")


def test_a_link_to_a_restarted_vehicle_is_not_kept(monkeypatch):
    assert not Bench(monkeypatch).vehicle._is_usable(LinkHealth.RESTARTED, "restarted")
