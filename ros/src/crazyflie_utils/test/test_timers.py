"""Timers in the order of their deadlines."""

import math
import threading
from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_utils.testing.programs import wait_until
from crazyflie_utils.timers import Executor, SimulatedClock, SteadyClock, TimerQueue

LIMIT = 60.0


def started():
    """Return an executor that has been started."""
    executor = Executor()
    executor.start()
    return executor


class Queue(TimerQueue):
    """A queue with a clock that is set when a timer is added."""

    def __init__(self, executor):
        self.clock = SimulatedClock()
        super().__init__(executor, self.clock)

    def add_at(self, period, work, now, stagger=False):
        """Add a timer at a moment."""
        self.clock.set(now)
        return self.add(period, work, stagger)


@pytest.fixture
def queue():
    return Queue(started())


def run(queue, *moments):
    for moment in moments:
        queue.run_due(moment)


def test_first_tick_is_one_period_after_the_beginning(queue):
    ticks = []
    queue.add_at(0.5, lambda: ticks.append(1), now=10.0)
    assert queue.next_deadline() == 10.5
    run(queue, 10.0, 10.4)
    assert ticks == []
    run(queue, 10.5)
    assert ticks == [1]
    assert queue.next_deadline() == 11.0


def test_without_timers_nothing_is_due(queue):
    assert queue.next_deadline() == math.inf
    run(queue, 1e9)


def test_ticks_run_in_the_order_of_their_deadlines(queue):
    order = []
    queue.add_at(0.3, lambda: order.append("slow"), now=0.0)
    queue.add_at(0.2, lambda: order.append("fast"), now=0.0)
    queue.add_at(0.3, lambda: order.append("slow too"), now=0.0)
    run(queue, 0.3)
    assert order == ["fast", "slow", "slow too"]


def test_what_is_due_at_one_moment_runs_in_the_order_in_which_it_was_added(queue):
    order = []
    for name, period, now in (("first", 0.01, 0.07), ("second", 0.01, 0.0), ("third", 0.1, 0.0)):
        queue.add_at(period, lambda name=name: order.append(name), now=now)
    for step in range(1, 101):
        order.clear()
        queue.run_due(step * 0.01)
        assert order == sorted(order)


def test_short_periods_that_a_process_begins_with_are_due_together(queue):
    ticks = []
    for name, period, now in (("a", 0.01, 1.0), ("b", 0.01, 1.0037), ("c", 0.02, 1.005)):
        queue.add_at(period, lambda name=name: ticks.append(name), now=now)
    queue.add_at(0.3, lambda: ticks.append("long"), now=1.005)
    for moment, due in ((1.01, "a"), (1.02, "ab"), (1.03, "ab"), (1.04, "abc"), (1.05, "ab")):
        ticks.clear()
        queue.run_due(moment)
        assert ticks == list(due)
    ticks.clear()
    queue.run_due(1.305)
    assert "long" in ticks
    # A caller may wait for work that is added later.
    queue.add_at(0.01, lambda: ticks.append("soon"), now=1.3337)
    queue.run_due(1.3436)
    assert "soon" not in ticks
    queue.run_due(1.3437)
    assert "soon" in ticks


def test_those_that_are_spread_are_due_one_after_the_other(queue):
    ticks = []
    for number in range(7):
        queue.add_at(0.05, lambda number=number: ticks.append(number), now=1.0, stagger=True)
    for moment, due in ((1.05, [0, 5]), (1.06, [1, 6]), (1.07, [2]), (1.08, [3]), (1.09, [4])):
        ticks.clear()
        queue.run_due(moment)
        assert ticks == due
    ticks.clear()
    queue.run_due(1.1)
    assert ticks == [0, 5]


def test_those_that_may_be_early_are_due_at_the_same_moments(queue):
    due = []
    queue.add_at(0.01, lambda: None, now=0.003)
    run(queue, 0.013)
    for name in "abcde":
        queue.add_at(9.0, lambda name=name: due.append(name), 0.017).set_period(0.04)
    queue.add_at(9.0, lambda: due.append("quick"), 0.0185).set_period(0.01)
    moments = {}
    while queue.next_deadline() < 0.06:
        now = queue.next_deadline()
        before = len(due)
        queue.run_due(now)
        moments[round(now * 1000)] = "".join(sorted(due[before:]))
    assert moments == {23: "aequick", 33: "bquick", 43: "cquick", 53: "dquick"}


def test_what_waits_is_submitted_before_the_timers_that_are_due():
    executor, done = started(), []
    queue = TimerQueue(
        executor, SimulatedClock(), collect=lambda: executor.submit(done.append, "message")
    )
    for name in ("first", "second"):
        queue.add(1.0, partial(done.append, name))
    queue.run_due(1.0)
    assert done == ["message", "first", "second"]


def test_rounding_makes_no_tick_late_or_double(queue):
    # As with /clock in steps of 1 ms, at the stamps that its messages can hold.
    ticks = []
    now = 0.0
    queue.add_at(0.01, lambda: ticks.append(now), now=now)
    for step in range(1, 200_001):
        now = step * 1_000_000 * 1e-9
        queue.run_due(now)
    assert ticks == [k * 10_000_000 * 1e-9 for k in range(1, 20_001)]


def test_times_as_large_as_wall_time_are_met(queue):
    ticks = []
    start = 1_700_000_000
    queue.add_at(0.01, lambda: ticks.append(1), now=float(start))
    for step in range(1, 1001):
        queue.run_due((start * 1000 + step * 10) * 1e-3)
    assert len(ticks) == 1000


@given(
    st.floats(1e-3, 10.0),
    st.floats(0.0, 1e6),
    st.lists(st.floats(1e-4, 50.0), min_size=1, max_size=40),
)
def test_missed_ticks_are_skipped_and_the_phase_is_kept(period, start, steps):
    queue = Queue(started())
    ticks = []
    now = start
    queue.add_at(period, lambda: ticks.append(now), now=start)
    expected = 0
    for step in steps:
        before = math.floor((now - start + 1e-6) / period)
        now += step
        after = math.floor((now - start + 1e-6) / period)
        expected += after > before
        queue.run_due(now)
        assert queue.next_deadline() > now
        assert queue.next_deadline() <= now + period * (1.0 + 1e-9) + 1e-6
        phase = (queue.next_deadline() - start) / period
        assert phase == pytest.approx(round(phase), abs=1e-6 * max(1.0, phase))
    # A step can end within rounding of a deadline.
    assert abs(len(ticks) - expected) <= 1
    assert len(set(ticks)) == len(ticks)


def test_period_of_zero_is_due_every_time(queue):
    ticks = []
    queue.add_at(0.0, lambda: ticks.append(1), now=1.0)
    run(queue, 1.0, 1.0, 1.5)
    assert len(ticks) == 3


def test_what_a_timer_submits_is_done_before_it_is_repeated():
    executor = started()
    queue = Queue(executor)
    done = []

    def tick():
        done.append("tick")
        executor.submit(done.append, "submitted")

    queue.add_at(0.0, tick, now=0.0)
    queue.add_at(1.0, lambda: done.append("second"), now=0.0)
    queue.run_due(1.0, times=2)
    assert done == ["tick", "submitted", "tick", "submitted", "second"]


def test_a_thread_does_not_wait_for_all_repetitions_of_a_timer():
    executor = started()
    queue = Queue(executor)
    has_returned = threading.Event()
    ticks = []

    def submit():
        executor.submit(lambda: None)
        has_returned.set()

    def tick():
        if not ticks:
            threading.Thread(target=submit, daemon=True).start()
            wait_until(lambda: executor._running._waiting, "the thread to wait")
        ticks.append(not ticks or has_returned.wait(LIMIT))

    queue.add_at(0.0, tick, now=0.0)
    queue.run_due(0.0, times=2)
    assert ticks == [True, True]


@pytest.mark.parametrize("period", [-1.0, math.nan, math.inf])
def test_other_periods_are_refused(queue, period):
    with pytest.raises(ValueError, match=f"period of a timer is {period}"):
        queue.add_at(period, lambda: None, now=0.0)


@pytest.mark.parametrize("period", [-1.0, math.nan, math.inf])
def test_a_timer_keeps_its_period_when_another_is_refused(queue, period):
    ticks = []
    timer = queue.add_at(1.0, lambda: ticks.append(1), now=0.0)
    with pytest.raises(ValueError, match=f"period of a timer is {period}"):
        timer.set_period(period)
    run(queue, 1.0, 2.0)
    assert (timer.period, len(ticks)) == (1.0, 2)


def test_a_timer_that_is_added_while_all_are_stopped_does_not_fire(queue):
    class Period(float):
        """A period that is checked while another thread stops the queue."""

        def __ge__(self, other):
            queue.stop()
            return super().__ge__(other)

    ticks = []
    queue.add(Period(1.0), lambda: ticks.append(1))
    run(queue, 1.0, 2.0)
    assert ticks == []


def test_stopped_timer_never_fires_again(queue):
    ticks = []
    timer = queue.add_at(1.0, lambda: ticks.append(1), now=0.0)
    run(queue, 1.0)
    timer.stop()
    run(queue, 2.0, 3.0)
    assert ticks == [1]
    assert queue.next_deadline() == math.inf


def test_timer_stopped_by_an_earlier_tick_does_not_fire_in_the_same_moment(queue):
    ticks = []
    queue.add_at(1.0, lambda: later.stop(), now=0.0)
    later = queue.add_at(1.0, lambda: ticks.append(1), now=0.0)
    queue._executor.submit(lambda: queue.run_due(1.0))
    assert ticks == []


def test_stopped_queue_never_fires_again():
    executor = Executor()
    queue = Queue(executor)
    ticks = []
    queue.add_at(1.0, lambda: ticks.append(1), now=0.0)
    queue.run_due(1.0)
    queue.stop()
    executor.start()
    queue.run_due(2.0)
    assert ticks == []


def test_rebase_after_a_reset(queue):
    ticks = []
    queue.add_at(0.5, lambda: ticks.append("a"), now=100.0)
    queue.add_at(0.2, lambda: ticks.append("b"), now=100.0)
    run(queue, 100.2)
    queue.rebase(0.0)
    assert queue.next_deadline() == 0.2
    run(queue, 0.2, 0.4, 0.5)
    assert ticks == ["b", "b", "b", "a"]


def test_reset_while_ticks_run_loses_no_timer(queue):
    ticks = []
    queue.add_at(1.0, lambda: queue.rebase(0.0), now=50.0)
    queue.add_at(1.0, lambda: ticks.append(1), now=50.0)
    run(queue, 51.0)
    assert queue.next_deadline() == 1.0
    run(queue, 1.0)
    assert ticks == [1, 1]


def test_timers_may_be_added_and_stopped_by_ticks(queue):
    ticks = []

    def tick():
        timer.stop()
        queue.add_at(0.1, lambda: ticks.append(1), now=1.0)

    timer = queue.add_at(1.0, tick, now=0.0)
    run(queue, 1.0, 1.1, 1.2)
    assert ticks == [1, 1]


@pytest.fixture
def steady():
    """Return timers by the machine's clock."""
    steady = TimerQueue(started(), SteadyClock())
    yield steady
    steady.stop()


def test_steady_timers_fire_after_start(steady):
    fired = threading.Event()
    steady.add(0.001, fired.set)
    assert not fired.is_set()
    steady.start()
    assert fired.wait(LIMIT)


def test_steady_timer_added_later_wakes_the_thread(steady):
    steady.start()
    steady.add(1e6, lambda: None)
    fired = threading.Semaphore(0)
    steady.add(0.001, fired.release)
    for _ in range(3):
        assert fired.acquire(timeout=LIMIT)


def test_steady_timers_do_not_fire_early(steady):
    clock = SteadyClock()
    moments = []
    done = threading.Event()

    def tick():
        moments.append(clock.time())
        if len(moments) == 5:
            done.set()

    begin = clock.time()
    steady.add(0.005, tick)
    steady.start()
    assert done.wait(LIMIT)
    for number, moment in enumerate(moments, start=1):
        assert moment >= begin + number * 0.005 - 1e-5


def test_no_steady_timer_fires_after_stop(steady):
    ticks = []
    fired = threading.Event()

    def tick():
        ticks.append(1)
        fired.set()

    steady.add(0.0, tick)
    steady.start()
    assert fired.wait(LIMIT)
    steady.stop()
    steady._thread.join(LIMIT)
    assert not steady._thread.is_alive()
    count = len(ticks)
    steady.run_due(1e12)
    assert len(ticks) == count
