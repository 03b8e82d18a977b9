"""Launch files for the time of a with block, each on a ROS master of its own."""

import contextlib
import os
import signal
import socket
import subprocess
from pathlib import Path

_END_LIMIT = 15.0
"""How long roslaunch may take to end after each signal, s."""


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
            yield process
        finally:
            _end(process)


def _end(process):
    for request in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        if process.poll() is None:
            os.killpg(process.pid, request)
        try:
            process.wait(_END_LIMIT)
            return
        except subprocess.TimeoutExpired:
            continue
