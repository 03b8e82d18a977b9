"""One journal is run again, and what its nodes do is compared with what they did."""

import contextlib
import cProfile
import enum
import gc
import io
import pdb
import pstats
import sys
import threading
import time
import traceback
from collections import defaultdict, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import genpy

from crazyflie_reports.received import first_difference, received_value
from crazyflie_utils import handle
from crazyflie_utils.journal.journal_file import INPUTS, Journal, JournalError, Kind, SourcesError
from crazyflie_utils.journal.replay import Replay
from crazyflie_utils.journal.replay_transport import DifferenceError, EndError
from crazyflie_utils.tasks import Tasks

_REMEMBERED = 200  #: Last messages of each topic, to find the one that is others.
_MAX_NOTES = 20  #: Lines about a journal, tracebacks counted as one.
_MAX_LINES = 30  #: Lines of a message, and rows of the table of a profile.
_HALF_US = 5e-7  #: Times are printed in us (s).
_UTILS = str(Path(handle.__file__).parent)


class Status(enum.IntEnum):
    """Outcome of a replay; the greatest one of several is the exit status of the program."""

    #: Its nodes read more than their handles gave, such as sockets.
    NOT_REPEATABLE = -1
    IDENTICAL = 0
    DIFFERENT = 1
    NOT_RUN = 2


@dataclass
class Outcome:
    """What came of the replay of a journal, for people; and what the process did.

    That is how long it ran (s), and the checksum of all that it published.
    """

    status: Status
    text: str
    time: float = 0.0
    digest: int = 0


#: ``report(time, position, inputs)``: time since the start (s), how much of the file is read
#: (bytes), how many inputs are begun.
Report = Callable[[float, int, int], None]


def replay(
    path: Path,
    others: Sequence[Path] = (),
    report: Report = lambda time, position, inputs: None,
    break_at: float | None = None,
    has_profile: bool = False,
    has_log: bool = False,
) -> Outcome:
    """Run a journal again.

    ``others`` are the journals in which the recorded value of a difference is looked for;
    ``report`` is called before each input, and again before each of those. A debugger stops in the
    first callback from ``break_at`` on (s since the start). With ``has_log`` the text has all that
    the nodes log.
    """
    try:
        run = _Run(Journal(path), others, report, has_log)
    except JournalError as error:
        return Outcome(Status.NOT_RUN, str(error))
    except DifferenceError as error:
        return Outcome(Status.DIFFERENT, f"{path}: different before its nodes are made: {error}")
    except EndError:
        return Outcome(Status.NOT_RUN, f"{path}: it ends before its nodes are made")
    # What the program has imported is not garbage of the nodes.
    gc.collect()
    gc.freeze()
    if not has_profile:
        return run.run(break_at)
    with cProfile.Profile() as profile:
        outcome = run.run(break_at)
    table = io.StringIO()
    stats = pstats.Stats(profile, stream=table).strip_dirs()
    stats.sort_stats("tottime").print_stats(_MAX_LINES)
    outcome.text += "\n" + table.getvalue().strip()
    return outcome


class _QuitError(BaseException):
    """The debugger was left."""


class _Run:
    """A replay, and what is to be said of it."""

    def __init__(self, journal: Journal, others: Sequence[Path], report: Report, has_log: bool):
        self._journal, self._report, self._has_log = journal, report, has_log
        self._others = [each for each in others if each != journal.path]
        self._replay = Replay(journal)
        self._replay.transport.on_publish = self._remember
        self._replay.transport.on_log = self._log
        self._published: defaultdict[str, deque[genpy.Message]] = defaultdict(
            lambda: deque(maxlen=_REMEMBERED)
        )
        self._notes: list[str] = []
        self._inputs = 0
        self._began = time.perf_counter()

    def run(self, break_at: float | None) -> Outcome:
        """Return the outcome."""
        replay, journal = self._replay, self._journal
        try:
            with replay, _stopping(replay.process.tasks) as stop:
                self._start()
                while replay.rows.next is not None:
                    if replay.rows.next.kind in INPUTS:
                        begin, self._inputs = replay.rows.next_time, self._inputs + 1
                        self._report(begin, journal.position, self._inputs)
                        if break_at is not None and begin >= break_at - _HALF_US:
                            break_at = None
                            stop()
                    self._survive(replay.step)
        except DifferenceError as error:
            return self._different(error)
        except EndError as error:
            self._note(f"the journal ends {self._place(error)}")
        except _QuitError:
            return self._outcome(Status.IDENTICAL, "identical until the debugger was left")
        except SourcesError as error:
            return Outcome(Status.NOT_REPEATABLE, f"{journal.header['node']}: not run: {error}")
        except JournalError as error:
            return self._outcome(Status.NOT_RUN, f"identical so far, and cannot go on: {error}")
        if journal.damage:
            text = f"identical so far, and then not known: {journal.damage}"
            return self._outcome(Status.NOT_RUN, text)
        if journal.header["clock"] != "manual" and not replay.rows.counts[Kind.SHUTDOWN]:
            self._notes.append(
                "it did not end by itself: it was killed or died after that, or a callback did not "
                "return"
            )
        return self._outcome(Status.IDENTICAL, "identical")

    def _start(self):
        rows = self._replay.rows
        if self._survive(self._replay.start):
            return
        if rows.next is not None:
            then = rows.describe(rows.next)
            raise DifferenceError(f"now it is not initialized, and ends; then {then}")
        self._note("it ends, since it is not initialized")

    def _survive(self, work: Callable[[], bool]) -> bool:
        """Return what work returns; false if it ends its thread, as callbacks can."""
        try:
            return work()
        except SystemExit as error:
            self._note("".join(traceback.format_exception(error)))
            return False

    def _remember(self, topic: str, message: genpy.Message) -> None:
        self._published[topic].append(message)

    def _log(self, level: str, text: str) -> None:
        if self._has_log:
            self._notes.append(f"{self._replay.rows.time:.6f} s [{level}] {text.strip()}")
        elif level in ("error", "fatal"):
            self._note(text)

    def _note(self, text: str) -> None:
        if len(self._notes) < _MAX_NOTES:
            self._notes.append(f"{self._replay.rows.time:.6f} s: {text.strip()}")

    def _outcome(self, status: Status, text: str) -> Outcome:
        passed, took = self._replay.rows.time, time.perf_counter() - self._began
        messages = self._replay.rows.counts[Kind.PUBLISHED]
        first = (
            f"{self._journal.header['node']}: {text}: {self._inputs:,} callbacks, "
            f"{messages:,} messages; {passed:.1f} s in {took:.1f} s, "
            f"{passed / took:.0f} times real time"
        )
        if began := self._journal.header.get("began"):
            first += f"; began {began}".replace("T", " ")
        text = "\n  ".join([first, *self._notes])
        return Outcome(status, text, passed, self._replay.transport.digest.value)

    def _different(self, error: DifferenceError) -> Outcome:
        replay = self._replay
        moment = datetime.fromtimestamp(replay.ros_time * 1e-9, UTC)
        self._notes += [
            f"{replay.rows.time:.6f} s ({moment:%Y-%m-%d %H:%M:%S} UTC, ROS time "
            f"{replay.ros_time * 1e-9:.6f}): {error}",
            *self._values(error),
            self._place(error),
            f"--break-at {replay.rows.time:.6f} stops there",
        ]
        return self._outcome(Status.DIFFERENT, "different, after what was identical")

    def _values(self, error: DifferenceError) -> list[str]:
        """Return the field that differs, and both values."""
        if error.published is None:
            return []
        topic, message = error.published
        node = self._journal.header["node"]
        published = list(self._published[topic])
        found = received_value(self._searched(), node, topic, published, self._replay.wall_time)
        if found is None:
            now = str(message).splitlines()[:_MAX_LINES]
            return [
                f"then: not known; the journal of another process that received {topic} has it",
                "now: " + "\n    ".join(now),
            ]
        receiver, then = found
        difference = first_difference(message, then)
        if difference is None:
            return [f"this message is as {receiver} received it: one that went before was not"]
        field, new, old = difference
        return [f"{field}: now {new!r}; then {old!r}, as {receiver} received it"]

    def _searched(self) -> Iterator[Path]:
        for path in self._others:
            self._report(self._replay.rows.time, self._journal.position, self._inputs)
            yield path

    def _place(self, error: BaseException) -> str:
        """Return in which callback, and where, an error was raised."""
        callback = where = ""
        for frame, line in traceback.walk_tb(error.__traceback__):
            file = frame.f_code.co_filename
            if found := _guarded_callback(frame):
                callback = f"{_name(found)} of {frame.f_locals['self'].name}, "
            elif file != __file__ and not file.startswith(_UTILS):
                where = f"{Path(file).name}:{line}, "
        return f"in {callback}{where}at {self._replay.input_name}"


def _guarded_callback(frame: FrameType | None) -> Any:
    """Return the callback, or task, of a node that a frame of its handle calls, or None."""
    if frame is None or frame.f_code.co_filename != handle.__file__:
        return None
    # Others only register it.
    is_inner = "<locals>" in frame.f_code.co_qualname
    return frame.f_locals.get("callback", frame.f_locals.get("work")) if is_inner else None


def _name(callback: Any) -> str:
    return getattr(callback, "__qualname__", repr(callback))


def _code(callback: Any) -> CodeType | None:
    while hasattr(callback, "func"):
        callback = callback.func
    return getattr(callback, "__code__", None)


class _Debugger(pdb.Pdb):
    """A debugger that can be left in a callback, where exceptions are caught."""

    def do_quit(self, arg: str) -> bool | None:
        """Leave debugger and replay."""
        raise _QuitError

    do_q = do_exit = do_EOF = do_quit  # noqa: N815 - The last one is the end of the input.


@contextlib.contextmanager
def _stopping(tasks: Tasks) -> Iterator[Callable[[], None]]:
    """Give a function that has a debugger stop in the next callback, or where a task goes on."""

    def trace(frame: FrameType, event: str, _: object) -> Any:
        callback = _guarded_callback(frame.f_back)
        if not is_awaited or callback is None or _code(callback) is not frame.f_code:
            return None
        is_awaited.clear()
        debugger.set_trace(frame)
        return debugger.trace_dispatch

    def go_on(frame: FrameType, event: str, argument: Any) -> Any:
        debugger.set_trace(frame)
        return debugger.trace_dispatch(frame, event, argument)

    def on_turn(_: int) -> None:
        # Each task has a thread, and tracing is that of a thread.
        if is_awaited:
            sys.settrace(trace)
            if frame := _waiting_frame():
                is_awaited.clear()
                frame.f_trace = go_on

    def stop() -> None:
        is_awaited.append(True)
        sys.settrace(trace)

    is_awaited: list[bool] = []
    debugger = _Debugger()
    tasks.on_turn = on_turn
    try:
        yield stop
    finally:
        sys.settrace(None)


def _waiting_frame() -> FrameType | None:
    """Return the frame of a node whose task has waited; None if it has only begun."""
    frame: FrameType | None = sys._getframe()
    while frame is not None:
        file = frame.f_code.co_filename
        if file != __file__ and not file.startswith(_UTILS):
            return None if file == threading.__file__ else frame
        frame = frame.f_back
    return None
