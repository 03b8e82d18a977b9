"""One piece of work at a time, in order."""

import threading

import pytest

from crazyflie_utils.timers import Executor, _FairLock

LIMIT = 60.0


@pytest.fixture
def executor():
    """Return an executor that has been started."""
    executor = Executor()
    executor.start()
    return executor


def in_threads(*targets):
    """Run functions in threads of their own, to their end."""
    threads = [threading.Thread(target=target, daemon=True) for target in targets]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(LIMIT)
        assert not thread.is_alive()


def test_nothing_runs_before_start():
    executor = Executor()
    done = []
    for number in range(3):
        executor.submit(lambda number=number: done.append(number))
    in_threads(lambda: executor.submit(lambda: done.append(3)))
    assert done == []
    executor.start()
    assert done == [0, 1, 2, 3]


def test_work_may_start_the_executor_again(executor):
    done = []

    def work():
        executor.submit(lambda: done.append("later"))
        executor.start()
        done.append("work")

    in_threads(lambda: executor.submit(work))
    assert done == ["work", "later"]


def test_submit_returns_when_the_work_is_done(executor):
    done = []
    executor.submit(lambda: done.append(1))
    assert done == [1]


def test_work_submitted_by_work_runs_after_it(executor):
    order = []

    def outer():
        executor.submit(lambda: inner("first"))
        executor.submit(lambda: inner("second"))
        order.append("outer")

    def inner(name):
        executor.submit(lambda: order.append(f"after {name}"))
        order.append(name)

    executor.submit(outer)
    assert order == ["outer", "first", "second", "after first", "after second"]


def test_each_of_several_begins_after_all_that_the_one_before_has_submitted(executor):
    order = []

    def work(name):
        executor.submit(order.append, f"after {name}")
        order.append(name)

    executor.submit_all([lambda: work("first"), lambda: work("second")])
    assert order == ["first", "after first", "second", "after second"]
    executor.submit(lambda: executor.submit_all([lambda: work("third"), lambda: work("fourth")]))
    assert order[4:] == ["third", "fourth", "after third", "after fourth"]


def test_several_wait_for_the_start():
    executor, order = Executor(), []
    executor.submit_all([lambda: order.append("first"), lambda: order.append("second")])
    assert order == []
    executor.start()
    assert order == ["first", "second"]


def test_first_come_first_served_from_outside(executor):
    running, go_on = threading.Event(), threading.Event()
    order = []

    def slow():
        running.set()
        assert go_on.wait(LIMIT)
        order.append("slow")

    slow_thread = threading.Thread(target=executor.submit, args=(slow,), daemon=True)
    slow_thread.start()
    assert running.wait(LIMIT)
    threads = []
    for number in range(5):
        submitted = len(executor._inputs)
        thread = threading.Thread(
            target=executor.submit, args=(lambda number=number: order.append(number),), daemon=True
        )
        thread.start()
        threads.append(thread)
        while len(executor._inputs) == submitted:
            thread.join(0.001)
    assert order == []
    go_on.set()
    for thread in [slow_thread, *threads]:
        thread.join(LIMIT)
    assert order == ["slow", 0, 1, 2, 3, 4]


def test_threads_never_meet_and_lose_nothing(executor):
    inside, met, done = [], [], []

    def work(name):
        inside.append(name)
        met.extend(inside[:-1])
        done.append(name)
        if name[1] % 7 == 0:
            executor.submit(lambda: done.append((*name, "inner")))
        inside.remove(name)

    def submitter(thread):
        def run():
            for number in range(200):
                executor.submit(lambda name=(thread, number): work(name))
                assert (thread, number) in done[-40:]

        return run

    in_threads(*[submitter(thread) for thread in range(8)])
    assert met == []
    assert len(done) == 8 * (200 + 29)
    for thread in range(8):
        assert [n[1] for n in done if n[0] == thread and len(n) == 2] == list(range(200))


def test_turns_are_given_in_the_order_they_were_asked_for():
    lock = _FairLock()
    turns = []

    def ask(name):
        with lock:
            turns.append(name)

    threads = []
    with lock:
        for name in range(3):
            thread = threading.Thread(target=ask, args=(name,), daemon=True)
            thread.start()
            threads.append(thread)
            while len(lock._waiting) == name:
                thread.join(0.001)
    # A plain lock would be ours again before the others have woken up.
    ask("again")
    assert turns == [0, 1, 2, "again"]
    in_threads(lambda: ask("later"))
    assert turns[-1] == "later"


def test_a_piece_of_work_that_raises_does_not_hold_up_the_rest(executor):
    with pytest.raises(ZeroDivisionError):
        executor.submit(lambda: 1 / 0)
    done = []
    in_threads(lambda: executor.submit(lambda: done.append(1)))
    assert done == [1]
