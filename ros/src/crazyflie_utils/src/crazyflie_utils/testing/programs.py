"""Programs for the time of a with block, ports for them, and waiting with a limit; without ROS."""

import contextlib
import os
import random
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from typing import Any

from crazyflie_utils.terminal import waiting

LIMIT = 60.0  #: Timeout of a wait (s).

#: Longest time until a program ends after each signal (s); roslaunch gives its nodes 15 s.
_END_LIMIT = 60.0

_PORTS = range(20000, 32768)  #: Ports above the usual ones of virtual vehicles.
_RANDOM = random.SystemRandom()  #: Processes of a test run have the same seed.


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    """Return a UDP (or, with SOCK_STREAM, a TCP) port of this machine that is free now.

    A program that requests any port does not get this one: it is not one of Linux's ephemeral
    ports.
    """
    for port in _RANDOM.sample(_PORTS, len(_PORTS)):
        with socket.socket(socket.AF_INET, kind) as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port
    raise OSError(f"no port of {_PORTS} is free")


@contextlib.contextmanager
def running(*command: object, **options: Any) -> Iterator[subprocess.Popen[Any]]:
    """Run a program, with options of `subprocess.Popen`; end it, and its children, by Ctrl-C.

    If they do not end, they are killed and TimeoutExpired is raised.
    """
    process = subprocess.Popen(list(map(str, command)), start_new_session=True, **options)
    try:
        yield process
    finally:
        if process.poll() is None:
            try:
                with waiting(f"until {command[0]} has ended"):
                    os.killpg(process.pid, signal.SIGINT)
                    process.wait(_END_LIMIT)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
                raise


def wait_until(
    condition: Callable[[], object],
    what: str = "a condition",
    limit: float = LIMIT,
    period: float = 0.01,
) -> None:
    """Wait until ``condition()``, checked every ``period`` (s); fail after ``limit`` (s)."""
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end, f"waited {limit:g} s for {what}"
        time.sleep(period)
