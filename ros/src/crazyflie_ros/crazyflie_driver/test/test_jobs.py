"""Jobs in their order, and urgent ones."""

import threading

import pytest

from crazyflie_driver.vehicle_base import MOST_JOBS, Jobs
from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess

LIMIT = 60.0


class Slow:
    """A job that goes on until it is told, or given up."""

    def __init__(self, handle):
        self.has_begun = threading.Event()
        self.free = threading.Event()
        self._handle = handle

    def __call__(self, job):
        self.has_begun.set()
        while not self.free.is_set():
            self._handle.outside(self.free.wait, 0.01)
            job.check()
        return "done"


class TurnJobs:
    """Jobs that are submitted in turn, as by callbacks."""

    def __init__(self, process, on_error=lambda text: None):
        self._process = process
        self._jobs = Jobs("test", process.handle("/driver").task, on_error)

    def submit(self, *arguments, **named):
        return self._in_turn(lambda: self._jobs.submit(*arguments, **named))

    def supersede(self, what):
        self._in_turn(lambda: self._jobs.supersede(what))

    def close(self):
        self._in_turn(self._jobs.close)

    def _in_turn(self, work):
        results = []
        self._process.executor.submit(lambda: results.append(work()))
        return results[0]


@pytest.fixture
def process():
    return FakeProcess()


@pytest.fixture
def jobs(process):
    jobs = TurnJobs(process)
    yield jobs
    jobs.close()


@pytest.fixture
def slow(process, jobs):
    slow = Slow(process.handle("/driver"))
    yield slow
    slow.free.set()


def test_jobs_keep_their_order(jobs):
    done = []
    for k in range(20):
        last = jobs.submit("test", lambda _, k=k: done.append(k))
    last.result(LIMIT)
    assert done == list(range(20))


def test_an_urgent_job_does_not_wait_and_ends_what_it_overtakes(jobs, slow):
    upload = jobs.submit("test", slow, is_flight=True)
    go_to = jobs.submit("test", lambda _: "flown", is_flight=True)
    other = jobs.submit("test", lambda _: "written")
    assert slow.has_begun.wait(LIMIT)
    assert jobs.submit("land", lambda _: "landed", urgent=True).result(LIMIT) == "landed"
    for given_up in (upload, go_to):
        with pytest.raises(ServiceError, match="given up for land"):
            given_up.result(LIMIT)
    assert other.result(LIMIT) == "written"
    # Later jobs are not affected.
    assert jobs.submit("test", lambda _: "flown", is_flight=True).result(LIMIT) == "flown"


def test_an_urgent_job_goes_beside_one_that_cannot_be_given_up(jobs, slow):
    writing = jobs.submit("test", slow)
    assert slow.has_begun.wait(LIMIT)
    assert jobs.submit("stop", lambda _: "stopped", urgent=True).result(LIMIT) == "stopped"
    assert not writing.done()
    slow.free.set()
    assert writing.result(LIMIT) == "done"


def test_a_running_job_that_is_too_late_to_be_given_up_tells_how_it_ended(process, jobs):
    """A caller is not told that a command failed which the vehicle has accepted meanwhile."""
    begun, free = threading.Event(), threading.Event()

    def send(job):
        begun.set()
        process.handle("/driver").outside(free.wait, LIMIT)
        return job.may_send()

    go_to = jobs.submit("test", send, is_flight=True)
    assert begun.wait(LIMIT)
    jobs.supersede("a landing of other vehicles")
    assert not go_to.done()
    free.set()
    assert go_to.result(LIMIT) is False


def test_what_nobody_waits_for_is_not_begun_and_what_runs_is_told(jobs, slow):
    running, begun = jobs.submit("test", slow), []
    waiting = jobs.submit("test", lambda _: begun.append(1))
    assert slow.has_begun.wait(LIMIT)
    assert waiting.cancel()
    assert running.cancel()
    # The job has given up by itself.
    assert jobs.submit("test", lambda _: "next").result(LIMIT) == "next"
    assert not slow.free.is_set()
    assert begun == []


def test_an_error_is_the_callers(jobs):
    def fail(_):
        raise ServiceError("no")

    with pytest.raises(ServiceError, match="no"):
        jobs.submit("test", fail).result(LIMIT)
    assert jobs.submit("test", lambda _: 1).result(LIMIT) == 1


def test_an_error_that_nobody_expects_is_logged(process):
    errors = []
    jobs = TurnJobs(process, errors.append)
    done = jobs.submit("the test", lambda _: int("one"))
    with pytest.raises(ValueError, match="one"):
        done.result(LIMIT)
    assert len(errors) == 1 and errors[0].startswith("the test failed: ValueError(")
    jobs.close()


def test_calls_without_an_answer_leave_no_threads(jobs, slow):
    running = jobs.submit("test", slow)
    assert slow.has_begun.wait(LIMIT)
    count = threading.active_count()
    waiting = [jobs.submit("test", slow) for _ in range(3 * MOST_JOBS)]
    assert threading.active_count() == count
    with pytest.raises(ServiceError, match=f"{MOST_JOBS} calls wait"):
        waiting[-1].result(LIMIT)
    assert not running.done()


def test_nothing_is_done_after_the_end(jobs):
    jobs.close()
    with pytest.raises(ServiceError, match="removed"):
        jobs.submit("test", lambda _: 1).result(LIMIT)
    assert not any(
        thread.name.startswith("test") and thread.join(LIMIT) for thread in threading.enumerate()
    )
