"""Offsets that are learned, against those that made the messages."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocap_optitrack.clock_offset import ClockOffset

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
def test_begins_anew_when_the_servers_clock_is_set(step):
    clock = ClockOffset()
    network = Network(50.0)
    network.run(clock, 3.0)
    network.server += step
    network.offset -= step
    assert not clock.update(*network.message())
    assert not clock.is_settled
    errors = network.run(clock, 3.0)
    assert errors
    assert all(0.0 < error < 0.0015 for error in errors)


def test_begins_anew_when_the_servers_clock_has_stood_still():
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
    assert clock.update(*network.message())
    assert clock.is_settled
    assert clock.to_local(network.server) == pytest.approx(network.local(network.server), abs=2e-3)
