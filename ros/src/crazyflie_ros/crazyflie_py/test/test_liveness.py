"""The watchdog of a link, with time by hand."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_py.liveness import LOST_AFTER, Liveness


def watch(liveness, begin, end, step=0.1):
    """Ask every ``step`` until ``end``; return when the link was first said to be lost."""
    for k in range(1, round((end - begin) / step) + 1):
        if liveness.is_lost(begin + k * step):
            return begin + k * step
    return None


def test_silence_is_noticed_after_half_a_second():
    liveness = Liveness(10.0)
    assert watch(liveness, 10.0, 12.0) == pytest.approx(10.6)
    assert liveness.age(12.0) == pytest.approx(2.0)


def test_a_packet_now_and_then_is_enough():
    liveness = Liveness(0.0)
    for k in range(1, 100):
        liveness.received(0.4 * k)
        assert watch(liveness, 0.4 * k, 0.4 * k + 0.4) is None


def test_when_the_machine_was_busy_the_vehicle_gets_a_new_period():
    liveness = Liveness(0.0)
    assert not liveness.is_lost(0.1)
    assert not liveness.is_lost(5.0)
    assert watch(liveness, 5.0, 6.0) == pytest.approx(5.3)


@given(st.lists(st.floats(0.01, 0.24), min_size=30, max_size=60))
def test_a_silent_vehicle_is_always_noticed(pauses):
    liveness, now = Liveness(0.0), 0.0
    verdicts = []
    for pause in pauses:
        now += pause
        verdicts.append(liveness.is_lost(now))
        assert verdicts[-1] == (now > LOST_AFTER)


def test_quality_is_the_share_of_answered_pings():
    liveness = Liveness(0.0)
    assert liveness.quality() == 1.0
    for k in range(100):
        liveness.ping_sent(bytes([k]))
        if k % 4:
            liveness.ping_answered(bytes([k]), 0.1 * k)
    assert liveness.quality() == pytest.approx(0.75, abs=0.05)


def test_an_answer_under_way_is_not_lost():
    liveness = Liveness(0.0)
    liveness.ping_sent(b"1")
    assert liveness.quality() == 1.0
    liveness.ping_answered(b"1", 0.0)
    liveness.ping_sent(b"2")
    assert liveness.quality() == 1.0
    liveness.ping_sent(b"3")
    assert liveness.quality() == 0.5
    liveness.ping_answered(b"2", 0.0)
    assert liveness.quality() == 1.0


def test_an_answer_may_be_received_before_the_ping_is_noted():
    liveness = Liveness(0.0)
    for content in (b"1", b"2", b"3"):
        liveness.ping_answered(content, 0.0)
        liveness.ping_sent(content)
    assert liveness.quality() == 1.0
