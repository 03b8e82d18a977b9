"""The watchdog of a link, with time by hand."""

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from crazyflie_link.link import LOST_AFTER, LinkHealth, LinkMonitor
from crazyflie_link.log import Uptime


def watch(monitor, begin, end, step=0.05, bad=LinkHealth.SILENT):
    """Ask every ``step`` until ``end``; return when the link was first said to be lost."""
    for k in range(1, round((end - begin) / step) + 1):
        if monitor.state(begin + k * step) is bad:
            return begin + k * step
    return None


def test_silence_is_noticed_within_half_a_second():
    monitor = LinkMonitor(10.0)
    assert watch(monitor, 10.0, 12.0) <= 10.5 + 1e-9
    assert monitor.age(12.0) == pytest.approx(2.0)


def test_a_packet_now_and_then_is_enough():
    monitor = LinkMonitor(0.0)
    for k in range(1, 100):
        monitor.received(0.4 * k)
        assert watch(monitor, 0.4 * k, 0.4 * k + 0.4) is None


def test_when_the_machine_was_busy_the_vehicle_gets_a_new_period():
    monitor = LinkMonitor(0.0)
    assert monitor.state(0.1) is LinkHealth.ALIVE
    assert monitor.state(5.0) is LinkHealth.ALIVE
    assert watch(monitor, 5.0, 6.0) == pytest.approx(5.25)


@given(st.lists(st.floats(0.01, 0.22), min_size=30, max_size=60))
def test_a_silent_vehicle_is_always_noticed(pauses):
    monitor, now = LinkMonitor(0.0), 0.0
    verdicts = []
    for pause in pauses:
        now += pause
        verdicts.append(monitor.state(now) is LinkHealth.SILENT)
        assert verdicts[-1] == (now > LOST_AFTER)


def test_quality_is_the_share_of_answered_pings():
    monitor = LinkMonitor(0.0)
    assert monitor.quality() == 1.0
    for k in range(100):
        monitor.ping_sent(bytes([k]))
        if k % 4:
            monitor.ping_answered(bytes([k]), 0.1 * k)
    assert monitor.quality() == pytest.approx(0.75, abs=0.05)


def test_an_answer_under_way_is_not_lost():
    monitor = LinkMonitor(0.0)
    monitor.ping_sent(b"1")
    assert monitor.quality() == 1.0
    monitor.ping_answered(b"1", 0.0)
    monitor.ping_sent(b"2")
    assert monitor.quality() == 1.0
    monitor.ping_sent(b"3")
    assert monitor.quality() == 0.5
    monitor.ping_answered(b"2", 0.0)
    assert monitor.quality() == 1.0


def test_an_answer_may_be_received_before_the_ping_is_noted():
    monitor = LinkMonitor(0.0)
    for content in (b"1", b"2", b"3"):
        monitor.ping_answered(content, 0.0)
        monitor.ping_sent(content)
    assert monitor.quality() == 1.0


def health(monitor, begin, end, pings, logs):
    """Receive for a while what is to come, at 10 Hz; return the states in between."""
    states = []
    for k in range(1, round((end - begin) / 0.1) + 1):
        now = begin + 0.1 * k
        if pings:
            monitor.received(now)
        if logs:
            monitor.log_received(now)
        states.append(monitor.state(now))
    return states


def test_pings_without_log_data_are_a_restart():
    monitor = LinkMonitor(0.0)
    monitor.expect_log(0.1, 0.0)
    assert set(health(monitor, 0.0, 2.0, True, True)) == {LinkHealth.ALIVE}
    states = health(monitor, 2.0, 3.0, True, False)
    assert states.index(LinkHealth.RESTARTED) <= 4


def test_a_vehicle_that_is_frozen_between_log_data_and_ping_is_silent():
    monitor = LinkMonitor(0.0)
    monitor.expect_log(0.01, 0.0)
    assert set(health(monitor, 0.0, 2.0, True, True)) == {LinkHealth.ALIVE}
    monitor.ping_answered(b"", 2.09)
    assert watch(monitor, 2.09, 4.0, step=0.01, bad=LinkHealth.RESTARTED) is None
    assert monitor.state(4.0) is LinkHealth.SILENT


def test_slow_log_blocks_get_more_time():
    monitor = LinkMonitor(0.0)
    monitor.expect_log(1.0, 0.0)
    assert set(health(monitor, 0.0, 3.9, True, False)) == {LinkHealth.ALIVE}
    assert LinkHealth.RESTARTED in health(monitor, 3.9, 4.5, True, False)


def test_after_a_silence_log_data_may_come_a_little_later():
    monitor = LinkMonitor(0.0)
    monitor.expect_log(0.1, 0.0)
    assert health(monitor, 0.0, 0.8, False, False)[-1] is LinkHealth.SILENT
    assert set(health(monitor, 0.8, 1.0, True, False)) == {LinkHealth.SILENT}
    assert set(health(monitor, 1.0, 1.2, True, True)) == {LinkHealth.ALIVE}
    assert health(monitor, 1.2, 2.0, False, False)[-1] is LinkHealth.SILENT
    assert health(monitor, 2.0, 2.5, True, False)[-1] is LinkHealth.RESTARTED


def test_half_of_the_packets_lost_is_a_poor_link_at_once():
    monitor = LinkMonitor(0.0)
    for k in range(40):
        monitor.ping_sent(bytes([k]))
        monitor.ping_answered(bytes([k]), 0.1 * k)
        assert not monitor.is_poor()
    for k in range(40, 46):
        monitor.ping_sent(bytes([k]))
        if k % 2:
            monitor.ping_answered(bytes([k]), 0.1 * k)
    assert monitor.is_poor()


HOUR_MS = 3_600_000
WRAP_MS = 1 << 24
"""The clock has 24 bits, which are 4.66 h."""


def restarts(*packets):
    """Return whether a restart is seen; packets are (clock in ms, arrival in s)."""
    uptime = Uptime()
    return any([uptime.has_restarted(clock % WRAP_MS, arrival) for clock, arrival in packets])


@pytest.mark.parametrize(
    ("packets", "restarted"),
    [
        ([(100, 0.0), (200, 0.1), (300, 0.2)], False),
        # Two blocks may overtake each other.
        ([(100, 0.0), (200, 0.1), (190, 0.1), (300, 0.2)], False),
        # The clock wraps every 4.66 h.
        ([(WRAP_MS - 16, 0.0), (WRAP_MS + 5, 0.02), (WRAP_MS + 100, 0.1)], False),
        ([(60_000, 0.0), (60_100, 0.1), (900, 2.0)], True),
        ([(60_000, 0.0), (90_000, 30.0)], False),
        # A radio that was off for an hour.
        ([(60_000, 0.0), (60_000 + HOUR_MS, 3600.0)], False),
        # Packets that waited for this machine: late, and then all at once.
        ([(1000, 0.0), (1100, 10.0), (6000, 10.0), (11_000, 10.0), (11_100, 10.1)], False),
        ([(1000, 0.0), (1100, 10.0), (11_100, 10.1), (1000, 12.0)], True),
    ],
)
def test_a_clock_that_was_reset_is_a_restart(packets, restarted):
    assert restarts(*packets) is restarted


@given(st.floats(0.1, 100.0), st.floats(1.5, 600.0))
def test_a_restart_is_noticed_however_long_the_vehicle_was_on(hours, silence):
    before = round(hours * HOUR_MS)
    # Shortly before the clock wraps by itself, silence or a late packet may be the reason.
    assume(before % WRAP_MS < WRAP_MS - 1000.0 * (silence + 60.0))
    packets = [(before - 100, 0.0), (before, 0.1), (1200, 0.1 + silence)]
    assert restarts(*packets)


@given(
    st.integers(0, WRAP_MS),
    st.lists(st.tuples(st.integers(1, 5000), st.floats(0.0, 20.0)), min_size=2, max_size=50),
)
def test_late_packets_and_slow_clocks_are_no_restart(clock, steps):
    """The arrivals are in order, and none comes before it was sent."""
    uptime, sent, arrived = Uptime(), 0.0, 0.0
    for step_ms, late in steps:
        clock, sent = clock + step_ms, sent + step_ms / 1000.0
        arrived = max(arrived, sent + late)
        assert not uptime.has_restarted(clock % WRAP_MS, arrived)


@given(
    st.integers(100, WRAP_MS - 1),
    st.lists(
        st.tuples(st.integers(0, 10 * HOUR_MS), st.integers(0, 100), st.floats(0.0, 20.0)),
        max_size=20,
    ),
)
def test_times_are_unwrapped_however_long_no_packet_came(first, steps):
    """A packet may be up to 100 ms older than the one before it."""
    uptime, clock = Uptime(), first
    for step_ms, older_ms, late in [(0, 0, 0.0), *steps]:
        clock += step_ms
        sent = clock - older_ms
        assert not uptime.has_restarted(sent % WRAP_MS, clock / 1000.0 + late)
        assert uptime.unwrapped(sent % WRAP_MS) == sent


def test_times_start_from_zero_after_a_restart():
    uptime = Uptime()
    uptime.has_restarted(WRAP_MS - 16, 0.0)
    uptime.has_restarted(5, 0.1)
    assert uptime.unwrapped(5) == WRAP_MS + 5
    assert uptime.has_restarted(900, 0.2) is False
    assert uptime.has_restarted(300, 2.0) is True
    assert uptime.unwrapped(300) == 300
