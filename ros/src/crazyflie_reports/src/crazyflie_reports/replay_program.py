"""The program replay: journals are run again side by side, and compared to the bit."""

import argparse
import multiprocessing
import os
import signal
import sys
import time
from collections import deque
from collections.abc import Iterator, Sequence
from ctypes import Structure, c_double, c_longlong
from multiprocessing.connection import wait
from multiprocessing.sharedctypes import RawValue
from pathlib import Path
from typing import Any

from tqdm import tqdm

from crazyflie_reports.replay import Outcome, Status, replay
from crazyflie_utils.journal.journal_file import INPUTS, SUFFIX, Journal

_DESCRIPTION = """
Run the nodes of journals again, with the same input and without ROS, and compare all that they do
with what they did. Exit status: 0 identical, 1 a difference, 2 a journal cannot be run, or not to
its end. Journals of nodes that read more than their handle gives, such as sockets, do not count,
beside others.
"""
#: Longest time that a callback may take (s): less than somebody waits.
_LIMIT = 60.0
_PERIOD = 0.2  #: Period of the progress bar (s).
#: Quick to start; the workers have no threads to inherit.
_FORK = multiprocessing.get_context("fork")


class _Progress(Structure):
    """What a worker has done; see `crazyflie_reports.replay.Report`, and how often it said so."""

    _fields_ = (
        ("time", c_double),
        ("position", c_longlong),
        ("inputs", c_longlong),
        ("reports", c_longlong),
    )


class _Worker:
    """A process that runs a journal again, and may die as the one did that is repeated."""

    def __init__(self, path: Path, others: Sequence[Path], options: dict[str, bool]):
        self.path, self.progress = path, RawValue(_Progress)
        self.connection, end = _FORK.Pipe(duplex=False)
        self._seen, self._seen_at = -1, time.monotonic()
        arguments = path, others, self.progress, options, end
        self._process = _FORK.Process(target=_work, args=arguments, daemon=True)
        self._process.start()
        end.close()

    def has_stopped(self) -> bool:
        """Return whether a callback has not returned for too long."""
        if self.progress.reports != self._seen:
            self._seen, self._seen_at = self.progress.reports, time.monotonic()
        return time.monotonic() - self._seen_at > _LIMIT

    def outcome(self) -> Outcome:
        """Return what the worker has sent, or how it died."""
        try:
            outcome: Outcome = self.connection.recv()
            return outcome
        except EOFError:
            self._process.join()
            return self.died(_describe_end(self._process.exitcode))
        finally:
            self.end()

    def end(self) -> None:
        """End the worker."""
        self._process.kill()
        self._process.join()
        self.connection.close()

    def died(self, reason: str) -> Outcome:
        """Return the outcome of a worker that ended before its journal did."""
        journal = Journal(self.path)
        inputs = sum(row.kind in INPUTS for row in journal.rows())
        done, moment = self.progress.inputs, self.progress.time
        place = f"at {moment:.6f} s, in callback {done:,}" if done else "at its start"
        node = journal.header["node"]
        if done == inputs and not journal.damage:
            text = f"{node}: identical up to its last callback, where it {reason} again: {place}"
            return Outcome(Status.IDENTICAL, text, moment)
        text = f"{node}: different: now it {reason} {place}; then it had {inputs:,} callbacks"
        return Outcome(Status.DIFFERENT, f"{text}\n  --break-at {moment:.6f} stops there", moment)


def _describe_end(code):
    return f"died by {signal.Signals(-code).name}" if code < 0 else f"exited with status {code}"


def _work(path, others, progress, options, connection):
    # The program ends its workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def report(moment, position, inputs):
        progress.time, progress.position, progress.inputs = moment, position, inputs
        progress.reports += 1

    connection.send(replay(path, others, report, **options))


def replay_all(
    paths: Sequence[Path], others: Sequence[Path] = (), **options: bool
) -> Iterator[Outcome]:
    """Run journals again, as many at a time as there are processors; yield their outcomes.

    They come in the order of the paths; ``others`` and ``options`` as for `replay.replay`.
    """
    waiting = deque(enumerate(paths))
    working: dict[int, _Worker] = {}
    outcomes: dict[int, Outcome] = {}
    sizes = [path.stat().st_size if path.is_file() else 0 for path in paths]
    with tqdm(total=sum(sizes), unit="B", unit_scale=True, disable=None, leave=False) as bar:
        try:
            for k in range(len(paths)):
                while k not in outcomes:
                    while waiting and len(working) < (os.cpu_count() or 1):
                        number, path = waiting.popleft()
                        working[number] = _Worker(path, others, options)
                    ready = wait([each.connection for each in working.values()], _PERIOD)
                    for number, worker in list(working.items()):
                        if worker.connection in ready:
                            outcomes[number] = working.pop(number).outcome()
                        elif worker.has_stopped():
                            reason = f"did not return from a callback within {_LIMIT:g} s"
                            worker.end()
                            outcomes[number] = working.pop(number).died(reason)
                    done = sum(sizes[each] for each in outcomes)
                    bar.n = done + sum(each.progress.position for each in working.values())
                    bar.refresh()
                yield outcomes[k]
        finally:
            for worker in working.values():
                worker.end()


def journals_of(paths: Sequence[Path]) -> list[Path]:
    """Return the journals that paths name, each a file or a folder; FileNotFoundError if none."""
    found: list[Path] = []
    for path in paths:
        files = sorted(path.glob(f"*{SUFFIX}")) if path.is_dir() else [path]
        if not files or not files[0].exists():
            what = f"no journal (*{SUFFIX}) in it" if path.is_dir() else "no such file"
            raise FileNotFoundError(f"{path}: {what}")
        found += files
    return list(dict.fromkeys(found))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; return its exit status."""
    parser = _parser()
    options: Any = parser.parse_args(arguments)
    try:
        paths = journals_of(options.journals)
    except FileNotFoundError as error:
        parser.error(str(error))
    # Whoever received a message has its values.
    folders = dict.fromkeys(path.parent for path in paths)
    others = [each for folder in folders for each in sorted(folder.glob(f"*{SUFFIX}"))]
    others = list(dict.fromkeys([*paths, *others]))
    if options.break_at is not None:
        if len(paths) > 1:
            parser.error(f"--break-at takes one journal, not {len(paths)}")
        # Here, where the terminal is.
        outcome = replay(paths[0], others, break_at=options.break_at, has_log=options.log)
        print(outcome.text)
        return outcome.status
    began, outcomes = time.monotonic(), []
    for outcome in replay_all(paths, others, has_profile=options.profile, has_log=options.log):
        outcomes.append(outcome)
        tqdm.write(outcome.text)
    if len(paths) > 1:
        longest, took = max(each.time for each in outcomes), time.monotonic() - began
        counts = [sum(each.status is status for each in outcomes) for status in Status]
        print(
            "{0} journals: {2} identical, {3} different, {4} not run to their ends, "
            "{1} not repeatable; ".format(len(paths), *counts)
            + f"{longest:.1f} s in {took:.1f} s, {longest / took:.0f} times real time"
        )
    sys.stdout.flush()
    worst = max(each.status for each in outcomes)
    return Status.NOT_RUN if worst is Status.NOT_REPEATABLE else worst


def _parser():
    parser = argparse.ArgumentParser(prog="replay", description=_DESCRIPTION)
    parser.add_argument(
        "journals",
        nargs="+",
        type=Path,
        metavar="JOURNAL",
        help=f"a journal (*{SUFFIX}), or a folder of journals",
    )
    parser.add_argument(
        "--break-at",
        type=float,
        metavar="SECONDS",
        help="stop in the debugger pdb in the callback at this time since the start, as printed",
    )
    parser.add_argument("--log", action="store_true", help="print what the nodes log, with times")
    parser.add_argument(
        "--profile", action="store_true", help="print in which functions the time was spent"
    )
    return parser
