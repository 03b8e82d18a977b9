"""A vehicle's jobs, one after the other, and urgent ones beside them."""

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any, TypeVar

from crazyflie_utils import ServiceError

Result = TypeVar("Result")

MOST_JOBS = 64
"""Jobs that may wait."""


@dataclass(eq=False)
class Job:
    """Something to be done.

    Attributes
    ----------
    work : callable
        ``work(job)`` is called in a thread of the worker.
    is_flight : bool
        Whether an urgent job takes its place.
    overtaken_by : str
        What has taken its place; empty as long as nothing has.
    done : Future
        Of its result.
    """

    work: Callable[["Job"], Any]
    is_flight: bool = False
    overtaken_by: str = ""
    done: Future[Any] = field(default_factory=Future)

    @property
    def is_valid(self) -> bool:
        """Whether nothing else has taken its place."""
        return not self.overtaken_by

    def check(self) -> None:
        """Raise `ServiceError` if something else has taken the place of this job."""
        if self.overtaken_by:
            raise ServiceError(f"given up for {self.overtaken_by}")

    def run(self) -> None:
        """Do it."""
        try:
            self.check()
            result = self.work(self)
        except BaseException as error:
            self.done.set_exception(error)
        else:
            self.done.set_result(result)


class Worker:
    """Two threads that do jobs in their order, and do not outlive the process.

    Urgent jobs have a thread of their own. They take the place of every flight job that was
    submitted before them: one that waits is given up, one that is at work is told.

    Parameters
    ----------
    name : str
        For the threads.
    """

    def __init__(self, name: str):
        self._wake = threading.Condition()
        self._waiting: dict[bool, deque[Job]] = {False: deque(), True: deque()}
        self._at_work: Job | None = None
        self._is_closed = False
        for urgent, suffix in ((False, ""), (True, "-urgent")):
            threading.Thread(
                target=self._run, args=(urgent,), name=name + suffix, daemon=True
            ).start()

    def submit(self, work: Callable[[Job], Result], is_flight: bool = False) -> Future[Result]:
        """Have ``work(job)`` done after the jobs before it; return the future of its result."""
        return self._put(Job(work, is_flight), urgent=False)

    def submit_urgent(self, what: str, work: Callable[[Job], Result]) -> Future[Result]:
        """Have ``work(job)`` done after earlier urgent ones, in the place of flight jobs."""
        self.overtake(what)
        return self._put(Job(work), urgent=True)

    def overtake(self, what: str) -> None:
        """Give up all flight jobs for something else."""
        with self._wake:
            waiting = self._waiting[False]
            for job in [*waiting, *([self._at_work] if self._at_work else [])]:
                if job.is_flight:
                    job.overtaken_by = what
            # Their turn may be far off, and somebody waits for the answer.
            given_up = [job for job in waiting if job.is_flight]
            self._waiting[False] = deque(job for job in waiting if not job.is_flight)
        for job in given_up:
            job.run()

    def close(self) -> None:
        """Take no more jobs, and end after those that wait."""
        with self._wake:
            self._is_closed = True
            self._wake.notify_all()

    def _put(self, job: Job, urgent: bool) -> Future[Any]:
        with self._wake:
            waiting = self._waiting[urgent]
            if self._is_closed:
                job.done.set_exception(ServiceError("the vehicle has been removed"))
            elif len(waiting) >= MOST_JOBS:
                job.done.set_exception(ServiceError(f"{MOST_JOBS} calls wait for the vehicle"))
            else:
                waiting.append(job)
                self._wake.notify_all()
        return job.done

    def _run(self, urgent):
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._waiting[urgent] or self._is_closed)
                if not self._waiting[urgent]:
                    return
                job = self._waiting[urgent].popleft()
                if not urgent:
                    self._at_work = job
            job.run()
            if not urgent:
                self._at_work = None
