"""Progress and time limits of a set-up, with a clock that is moved by hand."""

from types import SimpleNamespace

import pytest

from crazyflie_link import link as module
from crazyflie_link.errors import NoAnswerError, SetupError
from crazyflie_link.link import LinkSetup, LinkTimeouts

PACKETS = [
    ((15, 0, b""), "waiting for the first answer"),
    ((5, 0, b"\x03\x08\x01"), "log table of 264 items"),
    ((5, 0, b"\x02\x02\x01"), "log table, item 259 of 264"),
    ((4, 0, b"\x01"), "list of memories"),
    ((2, 0, b"\x03\x05\x00"), "parameter table of 5 items"),
    ((2, 0, b"\x02\x01\x00"), "parameter table, item 2 of 5"),
    ((2, 3, b""), "parameter types"),
    ((2, 1, b"\x00\x01\x00\x07"), "parameter values, 1 of 5"),
    ((2, 1, b"\x00\x02\x00\x07"), "parameter values, 2 of 5"),
]
#: None of these is progress; a value that has come already is none either.
OTHERS = [
    (0, 0, b"text"),
    (13, 1, b"\x00"),
    (15, 3, b""),
    (2, 0, b"\x02\x01"),
    (2, 0, b"\x07\x01\x00"),
]


@pytest.fixture
def clock(monkeypatch):
    clock = SimpleNamespace(now=100.0)
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: clock.now))
    return clock


@pytest.mark.parametrize("count", range(1, len(PACKETS) + 1))
def test_each_step_is_progress_and_is_named_where_it_ends(clock, count):
    setup = LinkSetup("udp://here", LinkTimeouts())
    for packet, _ in PACKETS[:count]:
        clock.now += 1.4
        setup.receive(*packet)
        setup.check(12)
    clock.now += 1.0
    for packet in OTHERS:
        setup.receive(*packet)
    if count == len(PACKETS):
        setup.receive(2, 1, b"\x00\x02\x01\x00")
    clock.now += 0.6
    with pytest.raises(SetupError) as caught:
        setup.check(12)
    assert f"stuck ({PACKETS[count - 1][1]}) for 1.5 s" in str(caught.value)


def test_progress_ends_after_the_whole_time(clock):
    setup = LinkSetup("udp://here", LinkTimeouts())
    for number in range(30):
        clock.now += 1.0
        setup.receive(2, 1, bytes([number, 0]))
        setup.check(12)
    clock.now += 0.1
    with pytest.raises(SetupError, match="not connected after 30 s"):
        setup.check(12)


def test_the_first_answer_has_a_limit_of_its_own(clock):
    setup = LinkSetup("udp://here", LinkTimeouts())
    clock.now += 1.9
    setup.check(-1)
    clock.now += 0.2
    with pytest.raises(NoAnswerError, match="no answer has come within 2 s"):
        setup.check(-1)
    setup.begin()
    setup.check(-1)


@pytest.mark.parametrize("protocol", [0, 3])
def test_firmware_that_is_too_old_is_refused_at_once(clock, protocol):
    setup = LinkSetup("udp://here", LinkTimeouts())
    setup.check(4)
    with pytest.raises(SetupError, match=f"protocol {protocol}, at least 4 is needed"):
        setup.check(protocol)
