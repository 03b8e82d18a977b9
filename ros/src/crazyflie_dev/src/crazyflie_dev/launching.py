"""Launch files for the time of a with block, each on a ROS master of its own."""

import contextlib
import os
import re
import signal
import socket
import subprocess
import time
from pathlib import Path

import rosgraph

_START_LIMIT = 30.0
"""How long roslaunch may take until its master answers, s."""

_END_LIMIT = 15.0
"""How long roslaunch may take to end after each signal, s."""

_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
_COMPLAINT = re.compile(r"\[(ERROR|FATAL)\]|RLException|process has died")


class LaunchError(Exception):
    """roslaunch has ended before anything ran; the text says what it complained of."""


def complaints(log: Path) -> list:
    """Return the lines of a roslaunch's output that say what is wrong."""
    lines = [_COLOUR.sub("", line) for line in log.read_text(errors="replace").splitlines()]
    return [line for line in lines if _COMPLAINT.search(line)]


def free_port() -> int:
    """Return a TCP port of this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextlib.contextmanager
def launched(arguments: list, log: Path):
    """Run roslaunch on a master of its own for the time of a with block.

    Parameters
    ----------
    arguments : list of str
        Package, launch file and its arguments.
    log : Path
        Receives what roslaunch and the nodes print.

    Raises
    ------
    LaunchError
        There is no master, because roslaunch refused its arguments for instance.
    """
    port = free_port()
    os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{port}"
    os.environ["ROS_IP"] = "127.0.0.1"
    with log.open("w") as output:
        process = subprocess.Popen(
            ["roslaunch", "-p", str(port), *arguments],
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            _wait_for_master(process, log)
            yield process
        finally:
            _end(process)


def _wait_for_master(process, log):
    deadline = time.monotonic() + _START_LIMIT
    while not rosgraph.is_master_online():
        if process.poll() is not None or time.monotonic() > deadline:
            reasons = complaints(log) or log.read_text(errors="replace").splitlines()[-3:]
            raise LaunchError("\n".join(["roslaunch has not started anything:", *reasons]))
        time.sleep(0.1)


def _end(process):
    for request in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        if process.poll() is None:
            os.killpg(process.pid, request)
        try:
            process.wait(_END_LIMIT)
            return
        except subprocess.TimeoutExpired:
            continue
