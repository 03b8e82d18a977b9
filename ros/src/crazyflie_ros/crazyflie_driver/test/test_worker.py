"""Jobs in their order, and urgent ones."""

import threading

import pytest

from crazyflie_driver.worker import MOST_JOBS, Worker
from crazyflie_utils import ServiceError

LIMIT = 60.0


class Slow:
    """A job that goes on until it is told, or given up."""

    def __init__(self):
        self.has_begun = threading.Event()
        self.free = threading.Event()

    def __call__(self, job):
        self.has_begun.set()
        while not self.free.wait(0.01):
            job.check()
        return "done"


@pytest.fixture
def worker():
    worker = Worker("test")
    yield worker
    worker.close()


@pytest.fixture
def slow(worker):
    slow = Slow()
    yield slow
    slow.free.set()


def test_jobs_keep_their_order(worker):
    done = []
    for k in range(20):
        last = worker.submit(lambda _, k=k: done.append(k))
    last.result(LIMIT)
    assert done == list(range(20))


def test_an_urgent_job_does_not_wait_and_ends_what_it_overtakes(worker, slow):
    upload = worker.submit(slow, is_flight=True)
    go_to = worker.submit(lambda _: "flown", is_flight=True)
    other = worker.submit(lambda _: "written")
    assert slow.has_begun.wait(LIMIT)
    assert worker.submit_urgent("land", lambda _: "landed").result(LIMIT) == "landed"
    for given_up in (upload, go_to):
        with pytest.raises(ServiceError, match="given up for land"):
            given_up.result(LIMIT)
    assert other.result(LIMIT) == "written"
    # What comes later is another matter.
    assert worker.submit(lambda _: "flown", is_flight=True).result(LIMIT) == "flown"


def test_an_urgent_job_goes_beside_one_that_cannot_be_given_up(worker, slow):
    writing = worker.submit(slow)
    assert slow.has_begun.wait(LIMIT)
    assert worker.submit_urgent("stop", lambda _: "stopped").result(LIMIT) == "stopped"
    assert not writing.done()
    slow.free.set()
    assert writing.result(LIMIT) == "done"


def test_an_error_is_the_callers(worker):
    def fail(_):
        raise ServiceError("no")

    with pytest.raises(ServiceError, match="no"):
        worker.submit(fail).result(LIMIT)
    assert worker.submit(lambda _: 1).result(LIMIT) == 1


def test_calls_without_an_answer_leave_no_threads(worker, slow):
    count = threading.active_count()
    waiting = [worker.submit(slow) for _ in range(3 * MOST_JOBS)]
    assert threading.active_count() == count
    with pytest.raises(ServiceError, match=f"{MOST_JOBS} calls wait"):
        waiting[-1].result(LIMIT)


def test_nothing_is_done_after_the_end(worker):
    worker.close()
    with pytest.raises(ServiceError, match="removed"):
        worker.submit(lambda _: 1).result(LIMIT)
    assert not any(
        thread.name.startswith("test") and thread.join(LIMIT) for thread in threading.enumerate()
    )
