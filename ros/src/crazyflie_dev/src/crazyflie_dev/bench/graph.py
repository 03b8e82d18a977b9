"""A running graph of nodes, as the operating system and another process see it."""

import json
import os
import subprocess
import sys
import time
import xmlrpc.client
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import rosgraph

from crazyflie_dev.bench.row import NotMeasuredError

_LIMIT = 60.0  #: How long, in s, anything may take until it is there.

_TICK = 1.0 / os.sysconf("SC_CLK_TCK")

_CALLER = "/bench"

Arrivals = list[tuple[str, int, int]]  #: Topic, arrival and stamp, in ns of the machine's clock.


def wait_for_service(name: str, limit: float = _LIMIT) -> None:
    """Wait until a service is offered, at most ``limit`` s."""
    end = time.monotonic() + limit
    while time.monotonic() < end:
        # There may be no master yet.
        try:
            if rosgraph.Master(_CALLER).lookupService(name):
                return
        except (rosgraph.MasterError, OSError):
            time.sleep(0.002)
    raise NotMeasuredError(f"there is no service {name} after {limit:g} s")


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
    total = 0.0
    for pid in processes:
        # Behind the name, which may have spaces.
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        total += (int(fields[11]) + int(fields[12])) * _TICK
    return total


def memory(processes: Iterable[int]) -> float:
    """Return the memory of processes, MiB; what some share is divided among them (PSS)."""
    total = 0
    for pid in processes:
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                total += int(line.split()[1])
    return total / 1024.0


def listen(seconds: float, *topics: tuple[str, str, str]) -> Arrivals:
    """Listen to topics, each a node, topic and type, in another process; see `listener`."""
    command = [sys.executable, "-m", "crazyflie_dev.bench.listener", str(seconds)]
    for topic in topics:
        command += topic
    done = subprocess.run(
        command, timeout=seconds + _LIMIT, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise NotMeasuredError(done.stderr.strip().splitlines()[-1])
    return [tuple(each) for each in json.loads(done.stdout)]
