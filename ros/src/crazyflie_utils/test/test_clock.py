"""The clocks a process can live by."""

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_utils import timers
from crazyflie_utils.timers import SimulatedClock, SteadyClock

SECOND = 1_000_000_000


class FakeMachine:
    """The time module, with clocks that are set by hand (ns)."""

    def __init__(self, wall, monotonic):
        self.wall = wall
        self.monotonic = monotonic
        self.interruption = 0

    def monotonic_ns(self):
        return self.monotonic

    def time_ns(self):
        wall, self.wall = self.wall, self.wall + self.interruption
        self.monotonic += self.interruption
        return wall + self.interruption


@pytest.fixture
def machine(monkeypatch):
    """Return the clocks of a machine that has been up for 50 s."""
    machine = FakeMachine(wall=1000 * SECOND, monotonic=50 * SECOND)
    monkeypatch.setattr(timers, "time", machine)
    return machine


def test_steady_clock_is_the_machines():
    steady = SteadyClock()
    before = time.monotonic()
    now = steady.time()
    assert before <= now <= time.monotonic()
    assert steady.stamp().to_sec() == pytest.approx(time.time(), abs=5.0)


def test_stamp_of_a_moment_is_its_wall_time(machine):
    steady = SteadyClock()
    moment = steady.time()
    machine.wall += 3 * SECOND
    machine.monotonic += 3 * SECOND
    assert steady.stamp().to_nsec() == 1003 * SECOND
    assert steady.stamp(moment).to_nsec() == 1000 * SECOND
    assert steady.stamp(moment + 4.5).to_nsec() == 1004.5 * SECOND


def test_same_moment_has_the_same_stamp_however_the_wall_clock_drifts(machine):
    steady = SteadyClock()
    machine.wall += 900_000
    assert steady.stamp(50.0).to_nsec() == 1000 * SECOND


def test_stamps_follow_a_wall_clock_that_is_set(machine):
    steady = SteadyClock()
    machine.wall -= 7 * SECOND
    assert steady.stamp(50.0).to_nsec() == 993 * SECOND


def test_an_interruption_between_two_readings_does_not_move_stamps(machine):
    steady = SteadyClock()
    machine.interruption = 5_000_000
    assert steady.stamp(50.0).to_nsec() == 1000 * SECOND


def test_simulated_clock_stands_still_until_it_is_set():
    simulated = SimulatedClock()
    assert simulated.time() == 0.0
    simulated.set(12.5)
    assert simulated.time() == 12.5
    assert simulated.stamp().to_nsec() == 12.5 * SECOND
    assert simulated.stamp(1.25).to_nsec() == 1.25 * SECOND


@given(st.integers(0, 10**14))
def test_stamps_of_simulated_time_are_exact_to_the_nanosecond(nanoseconds):
    simulated = SimulatedClock()
    simulated.set(nanoseconds * 1e-9)
    stamp = simulated.stamp()
    assert stamp.to_nsec() == pytest.approx(nanoseconds, abs=0.5 + nanoseconds * 2e-16)
    assert 0 <= stamp.nsecs < SECOND


def test_listeners_are_told_of_steps_and_resets():
    simulated = SimulatedClock()
    heard = []
    simulated.on_change(lambda moment, is_reset: heard.append((moment, is_reset)))
    for moment in (1.0, 2.0, 2.0, 0.5, 0.6):
        simulated.set(moment)
    assert heard == [(1.0, False), (2.0, False), (2.0, False), (0.5, True), (0.6, False)]
