"""One callback at a time: the counterpart of roscpp's single spin thread.

Every callback of every node in a process passes through one `Executor`, in the order of
submission. It has no thread of its own: the thread that submits work while the executor is free
runs it, and what is submitted meanwhile.
"""

import threading
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any


class _FairLock:
    """A lock that threads acquire in the order in which they asked for it.

    A thread that runs timers without a pause would win a plain lock over and
    over again, before those who wait for it have even woken up.
    """

    def __init__(self) -> None:
        self._guard = threading.Lock()
        self._held = False
        self._waiting: deque[threading.Lock] = deque()

    def __enter__(self) -> None:
        with self._guard:
            if not self._held:
                self._held = True
                return
            turn = threading.Lock()
            turn.acquire()
            self._waiting.append(turn)
        turn.acquire()

    def __exit__(self, *exception: object) -> None:
        with self._guard:
            if self._waiting:
                self._waiting.popleft().release()
            else:
                self._held = False


class Executor:
    """Run submitted work one piece at a time, first come, first served.

    Nothing runs before `start`. Work must not raise; `NodeHandle` ensures that.
    """

    def __init__(self) -> None:
        self._queue: deque[tuple[Callable[..., None], tuple[Any, ...]]] = deque()
        self._running = _FairLock()
        self._runner: int | None = None
        self._started = False

    def start(self) -> None:
        """Begin to run work, in the order of submission."""
        self._started = True
        if not self.is_running_here:
            self._drain()

    @property
    def is_running_here(self) -> bool:
        """Whether this thread runs work at present."""
        return self._runner == threading.get_ident()

    def submit(self, work: Callable[..., None], *arguments: Any) -> None:
        """Run ``work(*arguments)`` after all that was submitted before it.

        From outside, returns when the work is done. From inside running work,
        and before `start`, returns at once.
        """
        self._queue.append((work, arguments))
        if self._runner != threading.get_ident():
            self._drain()

    def submit_all(self, works: Iterable[Callable[[], None]]) -> None:
        """Submit several pieces of work; see `submit`.

        From outside, each begins after all that the one before has submitted.
        """
        items = [(work, ()) for work in works]
        if self._started and self._runner != threading.get_ident():
            self._drain(items)
        else:
            self._queue.extend(items)

    def _drain(self, items=()):
        if not self._started:
            return
        with self._running:
            self._runner = threading.get_ident()
            queue = self._queue
            try:
                while queue:
                    work, arguments = queue.popleft()
                    work(*arguments)
                for item in items:
                    queue.append(item)
                    while queue:
                        work, arguments = queue.popleft()
                        work(*arguments)
            finally:
                self._runner = None
