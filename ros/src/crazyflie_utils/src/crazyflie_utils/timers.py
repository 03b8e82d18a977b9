"""Clocks, timers, and one callback at a time: the counterpart of roscpp's single spin thread.

Every callback of every node in a process passes through one `Executor`, in the order of
submission. It has no thread of its own: the thread that submits work while the executor is free
runs it, and what is submitted meanwhile. Timers, by any clock, submit their callbacks to it.

A clock is the machine's steady clock, or simulated time. ``time()`` is for intervals: seconds that
never run backwards unless a simulation is reset. ``stamp(time)`` is for message headers.
"""

import contextlib
import heapq
import itertools
import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable
from operator import attrgetter
from typing import Any

import genpy
from typing_extensions import override

CLOCK_STEP = 0.02  #: A larger change of wall clock minus monotonic clock is a step (s).
_QUIET = 100_000  #: Longest time between two readings that were not interrupted (ns).
#: Drift between wall clock and monotonic clock above which stamps follow (ns).
_OFFSET_TOLERANCE = 1_000_000
_SECOND = 1_000_000_000  #: One second (ns).


def ros_time(nanoseconds: int) -> genpy.Time:
    """Return a time as a message has it, of whole nanoseconds since 1970."""
    # genpy checks the types of its arguments, which takes five times as long.
    time = genpy.Time.__new__(genpy.Time)
    time.secs, time.nsecs = divmod(nanoseconds, _SECOND)
    return time


class SteadyClock:
    """The machine's monotonic clock; stamps are wall-clock time, as ROS has it.

    The same moment always has the same stamp, unless the wall clock is set.
    """

    def __init__(self) -> None:
        self._offset = time.time_ns() - time.monotonic_ns()

    def time(self) -> float:
        """Return seconds since some fixed moment."""
        return time.monotonic_ns() * 1e-9

    def stamp(self, moment: float | None = None) -> genpy.Time:
        """Return the ROS time of a moment of this clock, by default now."""
        return ros_time(self.nanoseconds(moment))

    def nanoseconds(self, moment: float | None = None) -> int:
        """Return the same as `stamp` in whole ns."""
        now = time.monotonic_ns()
        return (now if moment is None else round(moment * 1e9)) + self.measure_offset()

    def measure_offset(self) -> int:
        """Return wall clock minus this clock, ns."""
        before = time.monotonic_ns()
        offset = time.time_ns() - before
        # Between two readings another thread may run for milliseconds; a
        # wall clock that was set is seen in the next quiet moment.
        is_quiet = time.monotonic_ns() - before < _QUIET
        if is_quiet and abs(offset - self._offset) > _OFFSET_TOLERANCE:
            self._offset = offset
        return self._offset


class SimulatedClock:
    """A clock that stands still until it is set: ROS's simulated time."""

    def __init__(self) -> None:
        self._time = 0.0
        self._listeners: list[Callable[[float, bool], None]] = []

    def time(self) -> float:
        """Return simulated seconds; 0 before the first `set`."""
        return self._time

    def stamp(self, moment: float | None = None) -> genpy.Time:
        """Return a moment of this clock, by default now, as ROS time."""
        return ros_time(self.nanoseconds(moment))

    def nanoseconds(self, moment: float | None = None) -> int:
        """Return the same as `stamp` in whole ns."""
        return round((self._time if moment is None else moment) * 1e9)

    def on_change(self, listener: Callable[[float, bool], None]) -> None:
        """Call ``listener(time, is_reset)`` after every `set`."""
        self._listeners.append(listener)

    def set(self, moment: float) -> None:
        """Move to ``moment`` (s); a step back is a reset of the simulation."""
        is_reset = moment < self._time
        self._time = moment
        for listener in self._listeners:
            listener(moment, is_reset)


class _FairLock:
    """A lock that threads acquire in the order in which they asked for it.

    A thread that runs timers without a pause would win a plain lock over and over again, before
    those who wait for it have even woken up: they waited for 7 ms, and up to 0.9 s, instead of
    0.1 ms (measured in November 2026).
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

    def give_way(self) -> None:
        """Let the threads that wait for the lock have it first."""
        if self._waiting:
            self.__exit__()
            self.__enter__()


class Executor:
    """Run submitted work one piece at a time.

    Work that comes from outside is an input, and inputs run in the order in which they come. What
    running work submits follows from it, and runs in its order before the next input. So the inputs
    alone decide everything that happens. Nothing runs before `start`. Work must not raise;
    `NodeHandle` ensures that.
    """

    def __init__(self) -> None:
        #: before_timers, before_timer: Called before the first of the timers that are due, and
        #: before each later one.
        self.before_timers: Callable[[], None] | None = None
        self.before_timer: Callable[[], None] | None = None
        self._inputs: deque[tuple[Callable[..., None], tuple[Any, ...]]] = deque()
        self._consequences: deque[tuple[Callable[..., None], tuple[Any, ...]]] = deque()
        self._running = _FairLock()
        self._runner: int | None = None
        self._started = False
        self._home = threading.get_ident()

    def start(self) -> None:
        """Begin to run work, first what was submitted by the thread that made the executor."""
        self._started = True
        # Running work would wait for its own end.
        if not self.is_running_here:
            self._drain()

    @property
    def is_started(self) -> bool:
        """Whether work is run."""
        return self._started

    @property
    def is_running_here(self) -> bool:
        """Whether this thread runs work at present."""
        return self._runner == threading.get_ident()

    @property
    def is_in_turn(self) -> bool:
        """Whether this thread runs work, or prepares all that will run."""
        here = threading.get_ident()
        return self._runner == here or (not self._started and self._home == here)

    def submit(self, work: Callable[..., None], *arguments: Any) -> None:
        """Run ``work(*arguments)``: as an input, or after the running work that submits it.

        From outside, returns when the work is done. From inside running work,
        and before `start`, returns at once.
        """
        here = threading.get_ident()
        if self._runner == here or (not self._started and self._home == here):
            self._consequences.append((work, arguments))
        else:
            self._inputs.append((work, arguments))
            self._drain()

    def post(self, work: Callable[..., None], *arguments: Any) -> None:
        """Run ``work(*arguments)`` as an input, also from inside running work; see `submit`."""
        self._inputs.append((work, arguments))
        if self._runner != threading.get_ident():
            self._drain()

    def enqueue(self, work: Callable[..., None], *arguments: Any) -> None:
        """Run ``work(*arguments)`` before the next input; from any thread, which does not wait."""
        self._inputs.append((work, arguments))

    def submit_all(self, works: Iterable[Callable[[], None]]) -> None:
        """Submit several pieces of work; see `submit`. They are looked for in their turn.

        From outside, each begins after all that the one before has submitted.
        """
        if self._started and self._runner != threading.get_ident():
            self._drain(works)
        else:
            self._consequences.extend((work, ()) for work in works)

    def take_turn(self) -> None:
        """Wait for the turn of this thread, which lasts until `end_turn`; inputs before it run."""
        self._running.__enter__()
        self._runner = threading.get_ident()
        self._run_queued()

    def end_turn(self) -> None:
        """Run what the work of this thread has submitted, and end its turn."""
        try:
            self._run_queued()
        finally:
            self._runner = None
            self._running.__exit__()

    def _drain(self, works=()):
        if not self._started:
            return
        with self._running:
            self._runner = threading.get_ident()
            try:
                self._run_queued()
                is_first = True
                if works and self.before_timers is not None:
                    self.before_timers()
                for work in works:
                    if not is_first:
                        self._running.give_way()
                        self._runner = threading.get_ident()
                        if self.before_timer is not None:
                            self.before_timer()
                    is_first = False
                    work()
                    self._run_queued()
            finally:
                self._runner = None

    def _run_queued(self):
        inputs, consequences = self._inputs, self._consequences
        while consequences or inputs:
            work, arguments = (consequences or inputs).popleft()
            work(*arguments)


#: Time by which a timer may be early (s): more than the rounding error of the seconds since 1970 as
#: a float, and negligible.
_TOLERANCE = 1e-6

#: Longest period of timers that are due together where possible (s): waking up takes more time than
#: most callbacks.
_TOGETHER = 0.1

#: Time between the deadlines of staggered timers (s): the period of most other timers.
_SLOT = 0.01


class Timer:
    """A callback that is due every ``period`` seconds; ends with `stop`."""

    def __init__(self, queue: "TimerQueue", work: Callable[[], None]):
        self.period = self.deadline = math.inf  #: Both in s; set by the queue, as is `number`.
        self.number = 0  #: Position among timers that are due at once.
        self.stopped = False
        self._queue = queue
        self._work = work

    @property
    def name(self) -> str:
        """Name of the callback."""
        return getattr(self._work, "__qualname__", "")

    def stop(self) -> None:
        """Stop the timer, even if it is due already."""
        self.stopped = True

    def set_period(self, period: float) -> None:
        """Change the period, s; the next deadline is at most one period from now.

        Then many timers with the same period are due at different moments.
        """
        if period != self.period and not self.stopped:
            self._queue.begin(self, period, stagger=True, align_phase=True)

    def restart(self, now: float) -> None:
        """Set the next deadline one period after ``now`` (s)."""
        self._start = now
        self._count = 1
        self.deadline = now + self.period

    def skip_to(self, now: float) -> None:
        """Set the next deadline to the first moment of its phase after ``now`` (s)."""
        if self.period == 0.0:
            self.deadline = now
            return
        # Multiples of the period do not add up rounding errors as sums do.
        self._count += 1
        self.deadline = self._start + self._count * self.period
        if self.deadline <= now + _TOLERANCE:
            passed = math.floor((now - self._start + _TOLERANCE) / self.period)
            self._count = max(self._count, passed + 1)
            self.deadline = self._start + self._count * self.period

    def fire(self) -> None:
        """Call the callback, unless the timer was stopped."""
        if not self.stopped:
            self._work()


_number = attrgetter("number")


class TimerQueue:
    """Timers by a clock, in the order of their deadlines; `run_due` runs them, or a thread.

    ``before(count)`` returns the work to run before as many timers that are due at once;
    ``after()`` is called after several, and ``collect()``, which submits what waits, before all.
    """

    def __init__(
        self,
        executor: Executor,
        clock: SteadyClock | SimulatedClock,
        before: Callable[[int], list[Callable[[], None]]] = lambda count: [],
        after: Callable[[], None] = lambda: None,
        collect: Callable[[], None] = lambda: None,
    ):
        self._executor = executor
        self._clock = clock
        self._before = before
        self._after = after
        self._collect = collect
        self._lock = threading.Lock()
        self._heap: list[tuple[float, int, Timer]] = []
        self._order = itertools.count()
        self._origin: float | None = None
        self._is_running = False
        self._spread: Counter[float] = Counter()
        self._is_stopped = False
        # Released when there is anything new. Waiting for a bare lock takes half the time of
        # waiting for a condition.
        self._news = threading.Lock()
        self._news.acquire()
        self._thread = threading.Thread(target=self._run, name="timers", daemon=True)

    def start(self) -> None:
        """Start a thread that runs the timers, by the machine's clock."""
        self._thread.start()

    def add(self, period: float, work: Callable[[], None], stagger: bool = False) -> Timer:
        """Add a timer whose first deadline is one period from now, or a little later.

        Before the first `run_due`, one of a period up to 0.1 s is due at multiples of it since the
        first timer began, so that many wake the process up together; those that ``stagger`` are due
        10 ms apart, up to one period later. Timers that are added later are not delayed. ValueError
        for a period that is negative or not finite.
        """
        timer = Timer(self, work)
        self.begin(timer, period, stagger)
        return timer

    def begin(self, timer: Timer, period: float, stagger: bool, align_phase: bool = False) -> None:
        """Set the period of a timer, s, and its first deadline by it, see `add`.

        With ``align_phase`` the deadline may be early, at one of those moments; a flight in one
        process would take 8 % more processor time without.
        """
        if not 0.0 <= period < math.inf:
            raise ValueError(f"the period of a timer is {period!r} s; expected a number >= 0")
        with self._lock:
            timer.period, timer.number = period, next(self._order)
            timer.restart(self._start(period, stagger, align_phase))
            timer.stopped |= self._is_stopped
            self._push(timer)
        self._wake_up()

    def _start(self, period, stagger, align_phase):
        """Return the moment one period before the first deadline."""
        now = self._clock.time()
        if period == 0.0 or (self._is_running and not align_phase):
            return now
        if not stagger:
            return self._next_multiple(period, now) if period <= _TOGETHER else now
        start = self._next_multiple(_SLOT, now)
        start += self._spread[period] % max(round(period / _SLOT), 1) * _SLOT
        self._spread[period] += 1
        if align_phase:
            # The first deadline is the first moment of its phase after now.
            start -= (math.floor((start - now - _TOLERANCE) / period) + 1) * period
        return start

    def _next_multiple(self, period, now):
        if self._origin is None or now < self._origin:
            self._origin = now
        passed = (now - self._origin - _TOLERANCE) / period
        return self._origin + math.ceil(passed) * period

    def next_deadline(self) -> float:
        """Return when the next timer is due; infinity without timers."""
        with self._lock:
            return self._heap[0][0] if self._heap else math.inf

    def run_due(self, now: float | None = None, times: int = 1) -> None:
        """Submit every timer that is due at ``now`` (s), by default in its turn, each once.

        Those with a period of zero are submitted ``times`` times. A timer that is late by more than
        a period skips the missed ticks and keeps its phase.
        """
        self._is_running = True
        self._collect()
        self._executor.submit_all(self._due_works(now, times))

    def _due_works(self, now, times):
        due = self._take_due(self._clock.time() if now is None else now)
        works = [timer.fire for timer in due for _ in range(1 if timer.period > 0.0 else times)]
        if due:
            yield from self._before(len(due))
        yield from works
        if len(due) > 1:
            yield self._after

    def rebase(self, now: float) -> None:
        """Set every deadline one period after ``now`` (s): time has been reset."""
        with self._lock:
            timers = [timer for _, number, timer in sorted(self._heap) if number == timer.number]
            self._heap.clear()
            for timer in timers:
                timer.restart(now)
                self._push(timer)

    def stop(self) -> None:
        """Stop all timers, even those that are due already."""
        with self._lock:
            self._is_stopped = True
            for _, _, timer in self._heap:
                timer.stop()
        self._wake_up()

    def _wake_up(self):
        # It may be released already.
        with contextlib.suppress(RuntimeError):
            self._news.release()

    def _run(self):
        while not self._is_stopped:
            wait = self.next_deadline() - self._clock.time()
            if wait > 0.0:
                self._news.acquire(timeout=min(wait, 1.0))
            if self.next_deadline() <= self._clock.time() + _TOLERANCE:
                # To find a timer that is due takes as long as a short callback.
                self.run_due(times=10)

    def _push(self, timer):
        heapq.heappush(self._heap, (timer.deadline, timer.number, timer))

    def _take_due(self, now):
        due: list[Timer] = []
        with self._lock:
            heap, limit = self._heap, now + _TOLERANCE
            while heap and heap[0][0] <= limit:
                _, number, timer = heapq.heappop(heap)
                # Of a timer whose period has changed, the earlier deadline is still there.
                if number == timer.number and not timer.stopped:
                    due.append(timer)
            # Deadlines of one moment differ by rounding only, which varies. The order is that of
            # registration, so that periods are even.
            if len(due) > 1 and due[-1].deadline - due[0].deadline < _TOLERANCE:
                due.sort(key=_number)
            for timer in due:
                timer.skip_to(now)
                self._push(timer)
        return due


class SimulatedTimers(TimerQueue):
    """Timers by simulated time; ValueError for a period of zero, whose moment would never end."""

    @override
    def begin(self, timer: Timer, period: float, stagger: bool, align_phase: bool = False) -> None:
        if period == 0.0:
            raise ValueError("a timer by simulated time needs a period > 0")
        super().begin(timer, period, stagger, align_phase)
