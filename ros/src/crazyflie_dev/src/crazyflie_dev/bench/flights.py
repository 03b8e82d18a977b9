"""Flights that are measured; each function returns values by the name of their row."""

import bisect
import contextlib
import os
import statistics
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from crazyflie_batch.bench import MANY, ONE, steps_per_second
from crazyflie_dev.bench import graph
from crazyflie_dev.bench.graph import NotMeasuredError
from crazyflie_dev.bench.page_client import PageClient
from crazyflie_utils.testing.launching import master
from crazyflie_utils.testing.programs import running

Figures = dict[str, float]

DURATION = 20.0  #: Duration of a measurement in a flight (s).
PERIOD = 0.01  #: Period of the controls (s).


def machine() -> Figures:
    """Measure the periods of a loop that only sleeps: no figure can be better than that."""
    due, moments = time.monotonic(), []
    for _ in range(500):
        due += PERIOD
        time.sleep(max(due - time.monotonic(), 0.0))
        moments.append(time.monotonic())
    return {"machine": 1e3 * float(np.percentile(np.diff(moments), 99))}


def batch() -> Figures:
    """Measure how fast many vehicles are computed at once, without ROS."""
    return {"batch_many": steps_per_second(MANY)[0], "batch_one": steps_per_second(ONE)[0]}


def start() -> Figures:
    """Measure the time from roslaunch to /takeoff: the median of three, after one to warm up."""
    times = []
    for _ in range(4):
        begin = time.monotonic()
        with graph.launched("sw_hover.launch", "composed:=true"):
            times.append(time.monotonic() - begin)
    return {"start": statistics.median(times[1:])}


# A hover of the software example: its costs, and how late its controls come.

_SEPARATE = (
    "/simulator",
    "/state_estimator",
    "/lqr_controller",
    "/takeoff_server",
    "/takeoff_control_filter",
)
_COMPOSED = ("/composed",)
HOVERS = {
    "separate": (_SEPARATE, ()),
    "composed": (_COMPOSED, ("composed:=true",)),
    "arrival": (_COMPOSED, ("composed:=true", "act_on_arrival:=true")),
}


def hover(name: str) -> Figures:
    """Measure a hover with the nodes and launch arguments of `HOVERS`."""
    nodes, arguments = HOVERS[name]
    # In one process all of them are the same node.
    simulator, estimator, *_, control_filter = nodes if len(nodes) > 1 else 3 * nodes
    topics = ((simulator, "/tf"), (estimator, "/state"), (control_filter, "/control/final"))
    with graph.launched("sw_hover.launch", *arguments):
        graph.call("/takeoff")
        processes = [graph.process_of(node) for node in nodes]
        with graph.cpu_load(processes) as alone:
            time.sleep(DURATION)
        with graph.cpu_load(processes) as watched:
            arrivals = graph.listen(DURATION, *topics)
        memory = graph.memory(processes)
    figures = {"cpu": alone[0], "cpu_watched": watched[0], "memory": memory}
    figures |= {"tf_rate": _rate(arrivals, "/tf"), **_latencies(arrivals)}
    return {f"{figure}_{name}": value for figure, value in figures.items()}


def _rate(arrivals, topic):
    times = [arrival for name, arrival, _ in arrivals if name == topic]
    # Messages of the first 0.5 s have waited while the listener connected to other topics.
    times = [each for each in times if each > times[0] + 500_000_000]
    if len(times) < 2:
        raise NotMeasuredError(f"nothing came on {topic}")
    return 1e9 * (len(times) - 1) / (times[-1] - times[0])


def _latencies(arrivals):
    states = {stamp: arrival for name, arrival, stamp in arrivals if name == "/state"}
    controls = [each[1:] for each in arrivals if each[0] == "/control/final"]
    # The filter passes a control on with its stamp, which is that of the pose.
    answers = [(arrival, stamp) for arrival, stamp in controls if stamp in states]
    if not answers:
        raise NotMeasuredError("no control was made from a state; does the vehicle fly?")
    latency = [(arrival - states[stamp]) * 1e-6 for arrival, stamp in answers]
    return {
        "latency_p50": float(np.percentile(latency, 50)),
        "latency_p99": float(np.percentile(latency, 99)),
        "pose_p50": float(np.percentile([1e-6 * (here - stamp) for here, stamp in answers], 50)),
    }


def simulated(suffix: str = "") -> Figures:
    """Measure how fast simulated time passes in a hover, for ``_watched`` with a listener."""
    clock = ("/composed", "/clock")
    arguments = ["rviz:=false", "composed:=true", "sim_time:=true", "real_time_factor:=0"]
    launch = ["roslaunch", "--dump-params", "crazyflie_examples", "sw_hover.launch", *arguments]
    # Not by roslaunch: programs that it starts beside the nodes listen to /clock, too.
    with tempfile.TemporaryDirectory() as folder, master(Path(folder) / "master"):
        dumped = subprocess.run(launch, check=True, capture_output=True)
        subprocess.run(["rosparam", "load", "-"], input=dumped.stdout, check=True)
        command = ["rosrun", "crazyflie_utils", "composed_node", "__name:=composed"]
        with running(*command, stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT):
            graph.wait_for_service("/takeoff")
            graph.call("/takeoff")
            process = [graph.process_of("/composed")]
            used = graph.cpu_time(process)
            if suffix:
                arrivals = graph.listen(DURATION, clock)
            else:
                first = graph.listen(0.2, clock)
                time.sleep(DURATION)
                arrivals = first[:1] + graph.listen(0.2, clock)[-1:]
            used = graph.cpu_time(process) - used
    if len(arrivals) < 2:
        raise NotMeasuredError("nothing came on /clock")
    (_, begin, first_stamp), (_, end, last_stamp) = arrivals[0], arrivals[-1]
    passed = last_stamp - first_stamp
    return {
        f"simulated_time{suffix}": passed / (end - begin),
        f"simulated_cpu{suffix}": passed * 1e-9 / used,
    }


# Many simulated vehicles in one process.

_MOST_PERIOD = 12.0  #: 99th percentile of the periods of a control every 10 ms in real time, ms.
_NUMBERS = range(10, 200, 10)
_SETTLING = 3.0  #: Until vehicles have a position, and, after a takeoff, hover, s.


def fleet(n: int | str) -> Figures:
    """Measure a hover of ``n`` vehicles whose process has one core."""
    n = int(n)
    with _flown_fleet(n) as process:
        time.sleep(_SETTLING)
        with graph.cpu_load([process]) as load:
            arrivals = _listen_to_fleet(n)
        memory = graph.memory([process])
    figures = {"cpu": load[0], "period": _percentile_99(_periods(arrivals)), "memory": memory}
    return {f"fleet_{n}_{figure}": value for figure, value in figures.items()}


def vehicles() -> Figures:
    """Find the most vehicles, in tens, that are flown in real time; more are taken to be slower."""
    position = bisect.bisect_left(
        _NUMBERS, True, key=lambda n: fleet(n)[f"fleet_{n}_period"] >= _MOST_PERIOD
    )
    return {"vehicles": float(_NUMBERS[0] + _NUMBERS.step * (position - 1))}


@contextmanager
def _flown_fleet(n: int, *arguments: str) -> Iterator[int]:
    """Fly ``n`` vehicles of sw_swarm.launch; yield their process, which has one core."""
    launch = ("sw_swarm.launch", f"n:={n}", *arguments)
    with graph.launched(*launch, service="/all/takeoff"):
        process = graph.process_of("/fleet")
        for thread in Path(f"/proc/{process}/task").iterdir():
            # Some are there for a moment only.
            with contextlib.suppress(ProcessLookupError):
                os.sched_setaffinity(int(thread.name), {0})
        time.sleep(_SETTLING)
        graph.call("/all/takeoff")
        yield process


def _listen_to_fleet(n):
    topics = (f"/cf{k}/control/final" for k in sorted({1, (n + 1) // 2, n}))
    arrivals = graph.listen(DURATION, *(("/fleet", topic) for topic in topics))
    if len(arrivals) < n:
        raise NotMeasuredError("no controls came")
    return arrivals


def _periods(arrivals):
    by_topic = ([row[1] for row in arrivals if row[0] == each] for each in {r[0] for r in arrivals})
    return [period for times in by_topic for period in np.diff(times)]


def _percentile_99(times):
    """Return the 99th percentile of times in ns, ms."""
    return 1e-6 * float(np.percentile(times, 99))


_URL = "http://127.0.0.1:8642"
_VEHICLES = 100
_ROUNDS = 3
_CLIMB = (
    0.5  #: Of all vehicles while it is measured, m: of a fleet in hover a page is sent nothing.
)
_LEAST_RATE = 15.0  #: Scenes that come in a s; the page sends 20 of vehicles in motion.


def dashboard() -> Figures:
    """Measure the dashboard beside a fleet in motion: without a page, and with one, in turns.

    Means, for a fleet's first minute is not like its second. The page is that of another computer:
    what drawing it costs is not the flight's.
    """
    alone, shown = [], []
    with _flown_fleet(_VEHICLES, "dashboard:=true"):
        graph.wait_for_service("/dashboard/get_loggers")
        for _ in range(_ROUNDS):
            time.sleep(_SETTLING)
            alone.append(_moving_fleet(_CLIMB))
            with PageClient(_URL) as page:
                time.sleep(_SETTLING)
                shown.append(_moving_fleet(-_CLIMB, page))
    before, after = np.mean(alone, axis=0), np.mean(shown, axis=0)
    return {
        "dashboard_idle": float(before[0]),
        "dashboard_page": float(after[0]),
        "dashboard_period": float(after[1] - before[1]),
        "dashboard_latency": float(after[2] - before[2]),
    }


def _moving_fleet(climb: float, page: PageClient | None = None) -> tuple[float, float, float]:
    """Return the dashboard's CPU, % of a core, and p99 of the control's period and latency, ms."""
    duration = round(DURATION) + 10
    graph.call(
        "/all/go_to", f"{{relative: true, goal: {{z: {climb}}}, duration: {{secs: {duration}}}}}"
    )
    before, began = page.scenes if page else 0, time.monotonic()
    with graph.cpu_load([graph.process_of("/dashboard")]) as load:
        arrivals = _listen_to_fleet(_VEHICLES)
    if page and (rate := (page.scenes - before) / (time.monotonic() - began)) < _LEAST_RATE:
        raise NotMeasuredError(f"{rate:.1f} scenes a s have come; expected {_LEAST_RATE:g} or more")
    latencies = [arrival - stamp for _, arrival, stamp in arrivals]
    return load[0], _percentile_99(_periods(arrivals)), _percentile_99(latencies)
