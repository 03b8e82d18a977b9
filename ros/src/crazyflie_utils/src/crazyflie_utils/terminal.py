"""What programs that launch others show on a terminal: what they wait for, and warnings only."""

import contextlib
import re
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO

_SHOWN_AFTER = 2.0  #: Time from which on a wait is shown (s).
_PERIOD = 0.5  #: Period at which its line is written again (s).
_CLEAR = "\r\x1b[K"

COLOUR = re.compile(r"\x1b\[[0-9;]*m")
_STAMP = re.compile(r"(?<=\] )\[[\d.]+(, [\d.]+)?\]: ")
_WARNING = re.compile(r"\[ *(WARN|ERROR|FATAL)\]|RLException|process has died|Traceback \(most")

_lock = threading.Lock()  # Of the last line on the terminal.


def say(line: str) -> None:
    """Print a line on stderr, in front of one that is shown; nothing on a closed terminal."""
    with _lock, contextlib.suppress(OSError):
        print(f"{_CLEAR if sys.stderr.isatty() else ''}{line}", file=sys.stderr, flush=True)


@contextlib.contextmanager
def waiting(text: str) -> Iterator[None]:
    """Show on a terminal what a with block waits for, and how long, from 2 s on."""
    if not sys.stderr.isatty():
        yield
        return
    is_over = threading.Event()
    begin = time.monotonic()

    def show():
        if is_over.wait(_SHOWN_AFTER):
            return
        with contextlib.suppress(OSError):
            while not is_over.is_set():
                with _lock:
                    passed = time.monotonic() - begin
                    print(f"{_CLEAR}{text}: {passed:.0f} s", end="", file=sys.stderr, flush=True)
                is_over.wait(_PERIOD)
            with _lock:
                print(_CLEAR, end="", file=sys.stderr, flush=True)

    shown = threading.Thread(target=show, daemon=True)
    shown.start()
    try:
        yield
    finally:
        is_over.set()
        shown.join()


def copy_output(
    output: IO[str], log: Path, on_line: Callable[[str], None] = lambda line: None
) -> None:
    """Copy what roslaunch and its nodes print to a log, until its end; show warnings and errors.

    ``on_line`` is called with each line, without its colours.
    """
    is_traceback = False
    with log.open("w") as file:
        for coloured in output:
            line = COLOUR.sub("", coloured).rstrip("\n")
            file.write(f"{line}\n")
            file.flush()
            on_line(line)
            begins = bool(_WARNING.search(line))
            if begins or is_traceback:
                say(_STAMP.sub("", line))
            # Its last line is not indented.
            is_traceback = "Traceback (most" in line or (is_traceback and line.startswith(" "))
