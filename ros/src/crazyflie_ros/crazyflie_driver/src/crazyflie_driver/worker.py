"""A thread for what may take time, so that callbacks need not wait."""

import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from crazyflie_utils import ServiceError

Result = TypeVar("Result")


class Worker:
    """Do one job after the other, in a thread that does not outlive the process.

    Parameters
    ----------
    name : str
        For the thread.
    """

    def __init__(self, name: str):
        self._jobs: queue.SimpleQueue[tuple[Callable[[], Any], Future[Any]] | None] = (
            queue.SimpleQueue()
        )
        self._is_closed = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def submit(self, work: Callable[[], Result]) -> Future[Result]:
        """Have ``work()`` done after the jobs before it; return the future of its result."""
        future: Future[Result] = Future()
        if self._is_closed:
            future.set_exception(ServiceError("the vehicle has been removed"))
        else:
            self._jobs.put((work, future))
        return future

    def close(self) -> None:
        """Take no more jobs, and end after those that wait."""
        self._is_closed = True
        self._jobs.put(None)

    def _run(self):
        while (job := self._jobs.get()) is not None:
            work, future = job
            try:
                result = work()
            except BaseException as error:
                future.set_exception(error)
            else:
                future.set_result(result)
