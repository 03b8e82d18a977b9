"""One callback at a time: the counterpart of roscpp's single spin thread.

rospy runs subscribers, timers and services in threads of their own, so that
two callbacks of one node can meet half way through. Here every callback of
every node in a process passes through one `Executor`, which runs them one at a
time in the order they were submitted. Nodes therefore need no locks, messages
keep their order, and a callback never runs before the nodes are complete.

No thread is handed anything: whoever submits work while the executor is free
runs it, and what is submitted meanwhile. Python's interpreter lock leaves
nothing to gain from more threads.
"""

import heapq
import itertools
import math
import threading
from collections import deque
from collections.abc import Callable


class Executor:
    """Run submitted work one piece at a time, first come, first served.

    Nothing runs before `start`. Work must not raise; `NodeHandle` sees to it.
    """

    def __init__(self):
        self._queue = deque()
        self._running = threading.Lock()
        self._runner = None
        self._started = False

    def start(self) -> None:
        """Begin to run work, first what has been submitted so far."""
        self._started = True
        self._drain()

    def submit(self, work: Callable[[], None]) -> None:
        """Run ``work`` after all that was submitted before it.

        From outside, returns when the work is done. From inside running work,
        returns at once.
        """
        self._queue.append(work)
        self._drain()

    def _drain(self) -> None:
        if not self._started or self._runner == threading.get_ident():
            return
        with self._running:
            self._runner = threading.get_ident()
            try:
                while self._queue:
                    self._queue.popleft()()
            finally:
                self._runner = None


class Timer:
    """A callback that is due every ``period`` seconds; ends with `stop`."""

    def __init__(self, period: float, work: Callable[[], None], deadline: float):
        self.period = period
        self.work = work
        self.deadline = deadline
        self.stopped = False

    def stop(self) -> None:
        """Let the timer never fire again."""
        self.stopped = True


class TimerQueue:
    """Timers in the order of their deadlines.

    Parameters
    ----------
    executor : Executor
        Where their callbacks run.
    """

    def __init__(self, executor: Executor):
        self._executor = executor
        self._lock = threading.Lock()
        self._heap = []
        self._order = itertools.count()

    def add(self, period: float, work: Callable[[], None], now: float) -> Timer:
        """Add a timer whose first deadline is one period from ``now`` (s)."""
        timer = Timer(period, work, now + period)
        self._push(timer)
        return timer

    def next_deadline(self) -> float:
        """Return when the next timer is due; infinity without timers."""
        with self._lock:
            return self._heap[0][0] if self._heap else math.inf

    def run_due(self, now: float) -> None:
        """Submit every timer that is due at ``now`` (s), in order, each once.

        A timer that is late by more than a period skips what it missed and
        keeps its phase.
        """
        for timer in self._pop_due(now):
            if timer.stopped:
                continue
            missed = 0
            if timer.period > 0.0:
                missed = math.floor((now - timer.deadline) / timer.period + 1e-9)
            timer.deadline += (missed + 1) * timer.period
            if timer.period == 0.0:
                timer.deadline = now
            self._push(timer)
            self._executor.submit(timer.work)

    def rebase(self, now: float) -> None:
        """Make every timer due one period from ``now`` (s): time has been reset."""
        with self._lock:
            timers = [entry[2] for entry in sorted(self._heap)]
            self._heap.clear()
        for timer in timers:
            timer.deadline = now + timer.period
            self._push(timer)

    def _push(self, timer: Timer) -> None:
        with self._lock:
            heapq.heappush(self._heap, (timer.deadline, next(self._order), timer))

    def _pop_due(self, now: float) -> list:
        due = []
        with self._lock:
            while self._heap and self._heap[0][0] <= now + 1e-9:
                due.append(heapq.heappop(self._heap)[2])
        return due


class SteadyTimers:
    """A thread that runs a queue of timers by a steady clock.

    Parameters
    ----------
    queue : TimerQueue
    clock : SteadyClock
    """

    def __init__(self, queue: TimerQueue, clock):
        self._queue = queue
        self._clock = clock
        self._wake = threading.Condition()
        self._stopped = False
        self._thread = threading.Thread(target=self._run, name="timers", daemon=True)

    def start(self) -> None:
        """Begin to fire."""
        self._thread.start()

    def add(self, period: float, work: Callable[[], None]) -> Timer:
        """Add a timer; its first deadline is one period from now."""
        timer = self._queue.add(period, work, self._clock.time())
        with self._wake:
            self._wake.notify()
        return timer

    def stop(self) -> None:
        """End the thread, after the callbacks it is running."""
        with self._wake:
            self._stopped = True
            self._wake.notify()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(timeout=1.0)

    def _run(self) -> None:
        while not self._stopped:
            with self._wake:
                wait = self._queue.next_deadline() - self._clock.time()
                if wait > 0.0 and not self._stopped:
                    self._wake.wait(min(wait, 1.0))
            self._queue.run_due(self._clock.time())
