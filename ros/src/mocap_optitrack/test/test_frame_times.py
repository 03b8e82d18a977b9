"""Times of frames: the offset of a server's clock, and arrivals without stamps."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocap_optitrack.frame_times import ArrivalTimes, ClockOffset, FrameOrder

PERIOD = 0.01


class Network:
    """A server's messages every 10 ms.

    Parameters
    ----------
    offset : float
        Local time minus server time, s.
    drift : float
        How much faster the local clock is, as a fraction.
    jitter : float
        Mean of the delay that varies, s.
    spikes : float
        Probability of a delay of up to half a second.
    """

    SHORTEST = 0.0002

    def __init__(self, offset, drift=0.0, jitter=0.001, spikes=0.0, seed=1):
        self.offset, self._drift = offset, drift
        self._jitter, self._spikes = jitter, spikes
        self._random = random.Random(seed)
        self.server = 1000.0
        self._arrival = -float("inf")

    def local(self, server):
        """Return the local time of a moment of the server's clock."""
        return server + self.offset + self._drift * (server - 1000.0)

    def message(self):
        """Return when the next message is sent and arrives."""
        self.server += PERIOD
        delay = self.SHORTEST + self._random.expovariate(1.0 / self._jitter)
        if self._random.random() < self._spikes:
            delay += 0.5 * self._random.random()
        # Messages do not overtake each other.
        self._arrival = max(self._arrival, self.local(self.server) + delay)
        return self.server, self._arrival

    def run(self, clock, seconds):
        """Deliver messages; return the errors of the offset after each."""
        errors = []
        for _ in range(round(seconds / PERIOD)):
            clock.update(*self.message())
            if clock.is_settled:
                errors.append(clock.to_local(self.server) - self.local(self.server))
        return errors


def test_nothing_is_known_before_half_a_second():
    clock = ClockOffset()
    network = Network(offset=0.0)
    assert network.run(clock, 0.48) == []
    assert len(network.run(clock, 1.0)) > 90


@given(st.floats(-1e6, 1e6), st.floats(-50e-6, 50e-6), st.integers(0, 1000))
def test_learns_the_offset_to_the_shortest_delay(offset, drift, seed):
    errors = Network(offset, drift, seed=seed).run(ClockOffset(), 15.0)
    # The shortest of 50 delays in the beginning, later of 500; and up to five seconds
    # of drift.
    assert all(-0.0003 < error < 0.0015 for error in errors)
    assert all(-0.0003 < error < 0.0006 for error in errors[500:])


@given(st.integers(0, 1000))
def test_is_not_led_astray_by_a_busy_network(seed):
    # In more than a third of the time something is stuck.
    network = Network(12.5, jitter=0.002, spikes=0.02, seed=seed)
    errors = network.run(ClockOffset(), 10.0)
    assert all(-1e-9 < error < 0.005 for error in errors)
    assert len(errors) > 500


@given(st.integers(0, 1000), st.floats(-50e-6, 50e-6))
def test_stamps_keep_their_order_and_distance(seed, drift):
    clock = ClockOffset()
    network = Network(0.0, drift, jitter=0.005, spikes=0.05, seed=seed)
    stamps = []
    for _ in range(1000):
        clock.update(*network.message())
        if clock.is_settled:
            stamps.append(clock.to_local(network.server))
    for before, after in zip(stamps, stamps[1:], strict=False):
        # A late message moves the offset the farther, the later it is: 1 ms in a second.
        assert 0.0 < after - before
    mean = (stamps[-1] - stamps[0]) / (len(stamps) - 1)
    assert mean == pytest.approx(PERIOD, rel=2e-3)


@pytest.mark.parametrize("step", [-300.0, -0.2, 0.2, 300.0])
def test_restarts_when_the_servers_clock_is_set(step):
    clock = ClockOffset()
    network = Network(50.0)
    network.run(clock, 3.0)
    network.server += step
    network.offset -= step
    verdicts = [clock.update(*network.message()) for _ in range(10)]
    assert verdicts[-1] is FrameOrder.RESTART
    assert set(verdicts[:-1]) <= {FrameOrder.OLD, FrameOrder.FOREIGN}
    assert not clock.is_settled
    errors = network.run(clock, 3.0)
    assert errors
    assert all(0.0 < error < 0.0015 for error in errors)


def settled():
    """Return a clock that is settled, and its network."""
    clock, network = ClockOffset(), Network(50.0)
    network.run(clock, 3.0)
    return clock, network


def test_a_message_that_comes_again_costs_nothing():
    clock, network = settled()
    first, second = network.message(), network.message()
    assert clock.update(*first) is FrameOrder.NEW
    for _ in range(50):
        assert clock.update(first[0], first[1] + 0.001) is FrameOrder.OLD
    assert clock.update(*second) is FrameOrder.NEW
    assert clock.update(first[0], second[1] + 0.001) is FrameOrder.OLD
    assert clock.is_settled
    assert clock.update(*network.message()) is FrameOrder.NEW


def test_messages_that_were_overtaken_are_old():
    clock, network = settled()
    messages = [network.message() for _ in range(30)]
    verdicts = []
    # Each third message comes first, and those before it follow.
    for k in range(0, 30, 3):
        for sent, _ in (messages[k + 2], messages[k], messages[k + 1]):
            verdicts.append(clock.update(sent, messages[k + 2][1]))
    assert verdicts == [FrameOrder.NEW, FrameOrder.OLD, FrameOrder.OLD] * 10
    assert clock.is_settled


@pytest.mark.parametrize("sent", [0.0, -1e300, 1e300, 1e9])
def test_one_message_of_another_clock_changes_nothing(sent):
    clock, network = settled()
    before = clock.to_local(0.0)
    arrival = network.message()[1]
    assert clock.update(sent, arrival) is FrameOrder.FOREIGN
    assert clock.update(*network.message()) is FrameOrder.NEW
    assert clock.to_local(0.0) == pytest.approx(before, abs=1e-3)


def test_two_servers_are_told_apart():
    clock, network = settled()
    other = Network(-700.0)
    for _ in range(200):
        sent, arrival = network.message()
        assert clock.update(sent, arrival) is FrameOrder.NEW
        assert clock.update(other.message()[0], arrival) is FrameOrder.FOREIGN


def test_restarts_when_the_servers_clock_has_stood_still():
    clock = ClockOffset()
    network = Network(50.0)
    network.run(clock, 3.0)
    # A second during which only local time has passed; no message shows that at once.
    network.offset += 1.0
    network.run(clock, 10.0)
    assert clock.to_local(network.server) == pytest.approx(network.local(network.server), abs=2e-3)


def test_a_pause_changes_nothing():
    clock = ClockOffset()
    network = Network(50.0)
    network.run(clock, 3.0)
    network.server += 60.0
    assert clock.update(*network.message()) is FrameOrder.NEW
    assert clock.is_settled
    assert clock.to_local(network.server) == pytest.approx(network.local(network.server), abs=2e-3)


READING = 0.0001
"""How long it takes to read a frame that is there, s."""


def stream(period, seconds, jitter=0.0, silence=(0.0, 0.0), seed=1):
    """Return when frames arrive (s), but for a time in which the system sends none."""
    generator = random.Random(seed)
    begin, end = silence
    times = [period * number for number in range(1, round(seconds / period))]
    return [time + jitter * period * generator.random() for time in times if not begin < time < end]


def read(arrivals, *stalls):
    """Return when frames are read by a reader that stands still in some intervals (s)."""
    moments, free = [], 0.0
    for arrival in arrivals:
        moment = max(arrival, free)
        for begin, end in stalls:
            if begin <= moment < end:
                moment = end
        free = moment + READING
        moments.append(free)
    return moments


def estimated(moments):
    """Return the estimates for these moments."""
    times = ArrivalTimes()
    return [times.update(moment) for moment in moments]


@pytest.mark.parametrize("period", [0.003, 0.01, 0.04])
def test_a_frame_that_is_waited_for_arrives_when_it_is_read(period):
    moments = read(stream(period, 3.0, jitter=0.4))
    assert estimated(moments) == moments


@pytest.mark.parametrize("period", [0.003, 0.01])
def test_a_backlog_is_as_old_as_it_is(period):
    arrivals = stream(period, 4.0, jitter=0.2)
    moments = read(arrivals, (1.0, 1.6), (2.0, 2.1), (2.13, 2.5))
    results = estimated(moments)
    late = 0
    for arrival, moment, time in zip(arrivals, moments, results, strict=True):
        if time is None:
            continue
        assert arrival - 2.0 * period < time < arrival + 2.0 * period
        late += moment - time > 0.2
    assert late > 0.5 / period
    # After each stall, and for nothing else.
    assert sum(time is None for time in results) == 3
    assert results[-1] == moments[-1]


def test_a_stall_that_costs_frames_is_over_when_frames_are_waited_for():
    arrivals = [time for time in stream(0.01, 4.0) if not 1.1 < time < 1.9]
    moments = read(arrivals, (1.0, 2.0))
    late = [m - t for m, t in zip(moments, estimated(moments), strict=True) if t is not None]
    assert max(late) > 0.8
    assert late[-150:] == [0.0] * 150


def test_a_stream_that_pauses_comes_back_with_its_second_frame():
    moments = read(stream(0.01, 4.0, silence=(1.0, 3.0)))
    results = estimated(moments)
    (unknown,) = [k for k, time in enumerate(results) if time is None]
    assert moments[unknown] == pytest.approx(3.0, abs=0.02)
    assert results[unknown + 1 :] == moments[unknown + 1 :]


@pytest.mark.parametrize(("before", "after"), [(0.01, 0.004), (0.01, 0.03), (0.004, 0.03)])
def test_a_rate_that_is_changed_is_learned(before, after):
    arrivals = stream(before, 2.0) + [2.0 + time for time in stream(after, 6.0)]
    moments = read(arrivals)
    assert estimated(moments)[-10:] == moments[-10:]
