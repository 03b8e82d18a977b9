"""Launch files for the time of a with block, each on a ROS master of its own."""

import contextlib
import os
import re
import socket
import subprocess
import time
from pathlib import Path
from typing import Any

import rosgraph
from roslaunch.core import RLException
from roslaunch.xmlloader import XmlParseException

from crazyflie_utils.launch_file import unknown_arguments
from crazyflie_utils.terminal import COLOUR, waiting
from crazyflie_utils.testing.programs import free_port, running

_START_LIMIT = 60.0  #: Longest time until roslaunch's master answers (s).

_COMPLAINT = re.compile(r"\[(ERROR|FATAL)\]|RLException|process has died")


class LaunchError(Exception):
    """roslaunch has started no node; the text says why."""


def complaints(log: Path) -> list[str]:
    """Return the lines with errors in a roslaunch's output."""
    lines = [COLOUR.sub("", line) for line in log.read_text(errors="replace").splitlines()]
    return [line for line in lines if _COMPLAINT.search(line)]


def roslaunch(
    arguments: list[str], log: Path
) -> contextlib.AbstractContextManager[subprocess.Popen[Any]]:
    """Run roslaunch on a master of its own for the time of a with block.

    The arguments are package, launch file and its arguments; the log receives what roslaunch and
    the nodes print. `LaunchError` if roslaunch ends before there is a master, or would ignore an
    argument.
    """
    try:
        problems = unknown_arguments(arguments)
    except (RLException, XmlParseException) as error:
        problems = [f"{arguments[0]}: {error}"]
    if problems:
        raise LaunchError("\n".join(problems))
    return _with_master(log, "roslaunch", *arguments)


def master(log: Path) -> contextlib.AbstractContextManager[subprocess.Popen[Any]]:
    """Run only a master for the time of a with block; its output goes to a log."""
    return _with_master(log, "rosmaster", "--core")


@contextlib.contextmanager
def _with_master(log, program, *arguments):
    """Run a program with a master on a free port, also that of this process."""
    port = free_port(socket.SOCK_STREAM)
    os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{port}"
    os.environ["ROS_IP"] = "127.0.0.1"
    command = (program, "-p", port, *arguments)
    with (
        log.open("w") as output,
        running(*command, stdout=output, stderr=subprocess.STDOUT) as process,
    ):
        deadline = time.monotonic() + _START_LIMIT
        with waiting("until a ROS master answers"):
            while not rosgraph.is_master_online():
                if process.poll() is not None or time.monotonic() > deadline:
                    reasons = complaints(log) or log.read_text(errors="replace").splitlines()[-3:]
                    raise LaunchError("\n".join(["roslaunch has not started anything:", *reasons]))
                time.sleep(0.02)
        yield process
