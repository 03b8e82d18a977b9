"""Runs single tests of pytest in forks of the process that has collected them."""

import itertools
import os
import pickle
import resource
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from types import CodeType, FrameType, FunctionType
from typing import Any, Self

import pytest
from _pytest.runner import runtestprotocol
from tqdm import tqdm

#: Processor time that the tests of a mutant take in all, s; what is slower is left out.
BUDGET = 5.0
#: A test may take so many times the processor time that it takes without a mutant, and 1 s.
_PATIENCE = 10.0
_LONGEST = 120.0  #: That a test may wait for what does not come, s.
_MEMORY = 4 << 30  #: Bytes that a fork may take.

Function = tuple[str, str]  #: Path of its module and qualified name.


class CallRecorder:
    """Within a ``with``: notes the Python functions that are called, in all threads to come."""

    def __init__(self) -> None:
        self._codes: dict[int, CodeType] = {}

    def __enter__(self) -> Self:
        sys.settrace(self._note)
        threading.settrace(self._note)
        return self

    def __exit__(self, *_: object) -> None:
        sys.settrace(None)
        threading.settrace(None)

    def _note(self, frame: FrameType, *_: object) -> None:
        # Called for functions only: it returns None, so their lines are not traced.
        code = frame.f_code
        self._codes[id(code)] = code

    def functions(self, paths: set[str]) -> set[Function]:
        """Return the functions of some modules; one within another counts as the outer one."""
        return {
            (code.co_filename, code.co_qualname.partition(".<locals>")[0])
            for code in list(self._codes.values())
            if code.co_filename in paths
        }


@dataclass(frozen=True)
class Test:
    """A test that passes, the functions that it calls, and its processor time, s."""

    item: pytest.Item
    functions: set[Function]
    duration: float


def measured(items: Sequence[pytest.Item], paths: set[str]) -> tuple[list[Test], list[str]]:
    """Run tests, each in a fork; return those that pass and start no program, and the others."""
    tests, others = [], []
    for item in tqdm(items, desc="tests", mininterval=2.0):
        functions, duration, fault = forked(partial(_measure, item, paths)) or (set(), 0.0, "died")
        if fault:
            others.append(f"{item.nodeid}: it {fault}")
        else:
            tests.append(Test(item, functions, duration))
    return tests, others


def within_budget(tests: Sequence[Test]) -> list[Test]:
    """Return the first of some tests, as many as take `BUDGET` together."""
    ends = itertools.accumulate(test.duration for test in tests)
    return [test for test, end in zip(tests, ends, strict=True) if end <= BUDGET]


def first_failure(functions: Sequence[FunctionType], code: CodeType, tests: Sequence[Test]) -> str:
    """Give functions another code; return the node id of the first test that fails, "" if none."""
    for function in functions:
        function.__code__ = code
    for test in tests:
        signal.setitimer(signal.ITIMER_PROF, _PATIENCE * test.duration + 1.0)
        signal.setitimer(signal.ITIMER_REAL, _LONGEST)
        if not _passes(test.item):
            return test.item.nodeid
    return ""


def forked(work: Callable[[], Any]) -> Any:
    """Return what a function returns in a fork without output; None if the fork dies."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            silence = os.open(os.devnull, os.O_RDWR)
            os.dup2(silence, 1)
            os.dup2(silence, 2)
            resource.setrlimit(resource.RLIMIT_DATA, (_MEMORY, _MEMORY))
            answer = pickle.dumps(work())
            with os.fdopen(writer, "wb") as pipe:
                pipe.write(answer)
        finally:
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        answer = pipe.read()
    os.waitpid(child, 0)
    return pickle.loads(answer) if answer else None


def _measure(item, paths):
    programs = []
    sys.addaudithook(lambda event, _: programs.append(1) if event == "subprocess.Popen" else None)
    signal.setitimer(signal.ITIMER_REAL, _LONGEST)
    begin = time.process_time()
    with CallRecorder() as recorder:
        passes = _passes(item)
    duration = time.process_time() - begin
    fault = "starts programs" if programs else "" if passes else "fails"
    return recorder.functions(paths), duration, fault


def _passes(item):
    # Nothing is kept for a next test: fixtures of modules are made, and noted, for each.
    return not any(report.failed for report in runtestprotocol(item, log=False))
