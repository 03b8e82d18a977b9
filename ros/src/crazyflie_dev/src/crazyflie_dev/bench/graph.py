"""A running graph of nodes, as the operating system and another process see it."""

import json
import subprocess
import sys
import tempfile
import time
import xmlrpc.client
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil
import rosgraph

from crazyflie_utils.testing.launching import roslaunch

_LIMIT = 60.0  #: Longest wait for a service, a reply or the listener, s.

_CALLER = "/bench"

Arrivals = list[tuple[str, int, int]]  #: Topic, arrival and stamp, in ns of the machine's clock.


class NotMeasuredError(Exception):
    """A figure cannot be had here; the text says why."""


@contextmanager
def launched(file: str, *arguments: str, service: str = "/takeoff") -> Iterator[None]:
    """Run a launch file of crazyflie_examples, without RViz, from when it offers a service on."""
    launch = ["crazyflie_examples", file, "rviz:=false", *arguments]
    with tempfile.TemporaryDirectory() as folder, roslaunch(launch, Path(folder) / "log"):
        wait_for_service(service)
        yield


def wait_for_service(name: str) -> None:
    """Wait until a service is offered; `NotMeasuredError` if there is none after 60 s."""
    end = time.monotonic() + _LIMIT
    while time.monotonic() < end:
        # There may be no master yet.
        try:
            if rosgraph.Master(_CALLER).lookupService(name):
                return
        except (rosgraph.MasterError, OSError):
            time.sleep(0.002)
    raise NotMeasuredError(f"there is no service {name} after {_LIMIT:g} s")


def call(service: str, *request: str) -> None:
    """Call a service and wait for its answer; the request is YAML, none for std_srvs/Empty."""
    command = ["rosservice", "call", service, *request]
    done = subprocess.run(command, timeout=_LIMIT, capture_output=True, text=True, check=False)
    if done.returncode:
        raise NotMeasuredError(f"{service}: {done.stderr.strip()}")


def process_of(node: str) -> int:
    """Return the process of a node, by the node's own answer."""
    uri = rosgraph.Master(_CALLER).lookupNode(node)
    slave: Any = xmlrpc.client.ServerProxy(uri)
    return int(slave.getPid(_CALLER)[2])


def cpu_time(processes: Iterable[int]) -> float:
    """Return the CPU time of processes until now, user and system, s."""
    return sum(sum(psutil.Process(pid).cpu_times()[:2]) for pid in processes)


@contextmanager
def cpu_load(processes: list[int]) -> Iterator[list[float]]:
    """Append to the list, at the end, the load by processes in a with block, % of a core."""
    load: list[float] = []
    used, began = cpu_time(processes), time.monotonic()
    yield load
    load.append(100.0 * (cpu_time(processes) - used) / (time.monotonic() - began))


def memory(processes: Iterable[int]) -> float:
    """Return the memory of processes, MiB; what some share is divided among them (PSS)."""
    return sum(psutil.Process(pid).memory_full_info().pss for pid in processes) / 2**20


def listen(seconds: float, *topics: tuple[str, str]) -> Arrivals:
    """Listen to topics, each a node and a topic, from another process; see `listener`."""
    # By its path, since a module of this name is also in the workspace that is compared.
    program = Path(__file__).with_name("listener.py")
    command = [
        sys.executable,
        str(program),
        str(seconds),
        *(word for each in topics for word in each),
    ]
    done = subprocess.run(
        command, timeout=seconds + _LIMIT, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise NotMeasuredError(done.stderr.strip().splitlines()[-1])
    return [tuple(each) for each in json.loads(done.stdout)]
