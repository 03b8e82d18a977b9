"""Flights that are measured; each function returns values by the name of their row.

The running graph is observed from outside, by the operating system and another program.
"""

import asyncio
import contextlib
import os
import re
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
import uuid
import xmlrpc.client
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import psutil
import rosgraph
import socketio

from crazyflie_reports.node_graph import FLYING
from crazyflie_utils.testing.launching import master, roslaunch
from crazyflie_utils.testing.programs import running

Figures = dict[str, float]

DURATION = 20.0  #: Duration of a measurement in a flight (s).
_LIMIT = 60.0  #: Longest wait for a service, or a reply, s.
_CALLER = "/bench"


class NotMeasuredError(Exception):
    """A figure cannot be measured here; the text says why."""


@contextmanager
def launched(file: str, *arguments: str, service: str = "/takeoff") -> Iterator[None]:
    """Run a launch file of crazyflie_examples, without RViz; enter when it offers a service."""
    launch = ["crazyflie_examples", file, "rviz:=false", *arguments]
    with tempfile.TemporaryDirectory() as folder, roslaunch(launch, Path(folder) / "log"):
        wait_for_service(service)
        yield


def wait_for_service(name: str) -> None:
    """Wait until a service is offered; `NotMeasuredError` after 60 s."""
    end = time.monotonic() + _LIMIT
    while time.monotonic() < end:
        # The master may not have started yet.
        with contextlib.suppress(rosgraph.MasterError, OSError):
            rosgraph.Master(_CALLER).lookupService(name)
            return
        time.sleep(0.002)
    raise NotMeasuredError(f"no service {name} after {_LIMIT:g} s")


def call(service: str, *request: str) -> None:
    """Call a service and wait for its answer; the request is YAML, none for std_srvs/Empty."""
    _output_of("rosservice", "call", service, *request)


def _output_of(*command: str) -> str:
    done = subprocess.run(command, timeout=_LIMIT, capture_output=True, text=True, check=False)
    if done.returncode:
        raise NotMeasuredError(f"{' '.join(command[:3])}: {done.stderr.strip()}")
    return done.stdout


def process_of(node: str) -> int:
    """Return the process of a node, by the node's own answer."""
    uri = rosgraph.Master(_CALLER).lookupNode(node)
    slave: Any = xmlrpc.client.ServerProxy(uri)
    return int(slave.getPid(_CALLER)[2])


def cpu_time(processes: Iterable[int]) -> float:
    """Return the CPU time of processes until now, user and system, s."""
    return sum(sum(psutil.Process(pid).cpu_times()[:2]) for pid in processes)


def cpu_load(processes: list[int]) -> float:
    """Return the load by processes over `DURATION`, % of a core."""
    used, began = cpu_time(processes), time.monotonic()
    time.sleep(DURATION)
    return 100.0 * (cpu_time(processes) - used) / (time.monotonic() - began)


def memory(processes: Iterable[int]) -> float:
    """Return the memory of processes, MiB; shared memory is divided among them (PSS)."""
    return sum(psutil.Process(pid).memory_full_info().pss for pid in processes) / 2**20


def start() -> Figures:
    """Measure the time from roslaunch to /takeoff: the median of three, after one to warm up."""
    times = []
    for _ in range(4):
        begin = time.monotonic()
        with launched("sw_hover.launch", "composed:=true"):
            times.append(time.monotonic() - begin)
    return {"start": statistics.median(times[1:])}


#: Name of a hover -> nodes and launch arguments.
HOVERS = {"separate": (sorted(FLYING), ()), "composed": (("/composed",), ("composed:=true",))}


def hover(name: str) -> Figures:
    """Measure a hover of the software example, one of `HOVERS`."""
    nodes, arguments = HOVERS[name]
    with launched("sw_hover.launch", *arguments):
        call("/takeoff")
        processes = [process_of(node) for node in nodes]
        load = cpu_load(processes)
        return {f"cpu_{name}": load, f"memory_{name}": memory(processes)}


_TURNS = 3  #: Number of hovers with journals, and of those without.


def journal() -> Figures:
    """Measure what journals cost in the software example, with and without them in turns."""
    nodes, _ = HOVERS["separate"]
    loads: dict[bool, list[float]] = {False: [], True: []}
    sizes = []
    for turn in range(2 * _TURNS):
        has_journal = turn % 2 == 1
        with tempfile.TemporaryDirectory() as folder:
            with launched("sw_hover.launch", *[f"journal:={folder}"] * has_journal):
                began = time.monotonic()
                call("/takeoff")
                loads[has_journal].append(cpu_load([process_of(node) for node in nodes]))
            if has_journal:
                written = sum(path.stat().st_size for path in Path(folder).iterdir())
                sizes.append(written / 2**20 / (time.monotonic() - began) * 60.0)
    without, with_them = statistics.mean(loads[False]), statistics.mean(loads[True])
    return {
        "journal_cpu": 100.0 * (with_them / without - 1.0),
        "journal_size": statistics.mean(sizes),
    }


#: Prints the stamp of a message on /clock and the time at which it came, ns.
_CLOCK = """
import time, rospy
from rosgraph_msgs.msg import Clock
rospy.init_node("bench_clock", anonymous=True)
print(rospy.wait_for_message("/clock", Clock, 30.0).clock.to_nsec(), time.time_ns())
"""


def _look_at_clock() -> tuple[int, int]:
    stamp, arrival = _output_of(sys.executable, "-c", _CLOCK).split()
    return int(stamp), int(arrival)


def simulated() -> Figures:
    """Measure the speed of simulated time in a hover; /clock is received at begin and end only."""
    arguments = ["rviz:=false", "composed:=true", "sim_time:=true", "real_time_factor:=0"]
    launch = ["roslaunch", "--dump-params", "crazyflie_examples", "sw_hover.launch", *arguments]
    # Not by roslaunch: programs that it starts in addition to the nodes also listen to /clock.
    with tempfile.TemporaryDirectory() as folder, master(Path(folder) / "master"):
        dumped = subprocess.run(launch, check=True, capture_output=True)
        subprocess.run(["rosparam", "load", "-"], input=dumped.stdout, check=True)
        command = ["rosrun", "crazyflie_utils", "composed_node", "__name:=composed"]
        with running(*command, stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT):
            wait_for_service("/takeoff")
            call("/takeoff")
            process = [process_of("/composed")]
            first_stamp, begin = _look_at_clock()
            used = cpu_time(process)
            time.sleep(DURATION)
            used = cpu_time(process) - used
            last_stamp, end = _look_at_clock()
    speed = (last_stamp - first_stamp) / (end - begin)
    return {"simulated_time": speed, "simulated_cpu": speed * DURATION / used}


_SETTLING = 3.0  #: Time until vehicles have a position, and, after a takeoff, hover (s).


def fleet(n: str) -> Figures:
    """Measure a hover of ``n`` vehicles whose process has one core."""
    with _flown_fleet(int(n)) as process:
        load = cpu_load([process])
        return {f"fleet_{n}_cpu": load, f"fleet_{n}_memory": memory([process])}


@contextmanager
def _flown_fleet(n: int, *arguments: str) -> Iterator[int]:
    """Fly ``n`` vehicles of sw_swarm.launch; yield their process, which has one core."""
    with launched("sw_swarm.launch", f"n:={n}", *arguments, service="/all/takeoff"):
        process = process_of("/fleet")
        for thread in Path(f"/proc/{process}/task").iterdir():
            # Some threads exist for a moment only.
            with contextlib.suppress(ProcessLookupError):
                os.sched_setaffinity(int(thread.name), {0})
        time.sleep(_SETTLING)
        call("/all/takeoff")
        time.sleep(_SETTLING)
        yield process


_URL = "http://127.0.0.1:8642"
_VEHICLES = 100
_CLIMB = 0.5  #: Climb of all vehicles (m): for a hovering fleet a page receives nothing.
_LEAST_RATE = 15.0  #: Least rate of scenes (1/s); the page sends 20 of moving vehicles.


def dashboard() -> Figures:
    """Measure the dashboard with a moving fleet: without a page, and with one.

    The page represents that of another computer: its drawing does not load the flight's.
    """
    with _flown_fleet(_VEHICLES, "dashboard:=true"):
        wait_for_service("/dashboard/get_loggers")
        process = [process_of("/dashboard")]
        _move_fleet(_CLIMB)
        alone = cpu_load(process)
        with PageClient(_URL) as page:
            time.sleep(_SETTLING)
            _move_fleet(-_CLIMB)
            before, began = page.scenes, time.monotonic()
            shown = cpu_load(process)
            rate = (page.scenes - before) / (time.monotonic() - began)
    if rate < _LEAST_RATE:
        raise NotMeasuredError(f"{rate:.1f} scenes a s have come; expected {_LEAST_RATE:g} or more")
    return {"dashboard_idle": alone, "dashboard_page": shown}


def _move_fleet(climb):
    duration = round(DURATION) + 10
    goal = f"{{relative: true, goal: {{z: {climb}}}, duration: {{secs: {duration}}}}}"
    call("/all/go_to", goal)


_NICENESS = 19  #: Niceness of the page: a browser on another computer would not load this one.


class PageClient:
    """A page without a browser, for the time of a with block: it draws nothing.

    It connects to an address such as http://127.0.0.1:8642 as NiceGUI's script in a browser does,
    and reads in a thread of its own.
    """

    def __init__(self, url: str):
        self.scenes = 0  #: Received messages with the poses of all vehicles.
        self._url = url
        self._is_open, self._is_over = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._read()), daemon=True)

    def __enter__(self) -> "PageClient":
        self._thread.start()
        if not self._is_open.wait(_LIMIT):
            raise NotMeasuredError(f"{self._url} is not a page of NiceGUI 3, or does not answer")
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        self._thread.join(_LIMIT)

    async def _read(self) -> None:
        # In Linux the niceness belongs to a thread.
        os.nice(_NICENESS)
        with urllib.request.urlopen(self._url, timeout=_LIMIT) as answer:
            (client_id,) = re.findall(r"'client_id': '([^']+)'", answer.read().decode())
        query = {
            "client_id": client_id,
            "document_id": uuid.uuid4(),
            "tab_id": uuid.uuid4(),
            "next_message_id": 0,
            "implicit_handshake": "true",
        }
        client = socketio.AsyncClient(reconnection=False)
        client.on("vehicles", self._on_vehicles)
        await client.connect(
            f"{self._url}/?{urlencode(query)}",
            headers={"Origin": self._url},
            transports=["websocket"],
            socketio_path="/_nicegui_ws/socket.io",
            wait_timeout=_LIMIT,
        )
        self._is_open.set()
        while not self._is_over.is_set():
            await asyncio.sleep(0.1)
        await client.disconnect()

    def _on_vehicles(self, _: object) -> None:
        self.scenes += 1
