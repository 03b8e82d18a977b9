"""How many simulated vehicles one core flies in real time."""

import bisect
import contextlib
import os
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from crazyflie_dev.bench import graph
from crazyflie_dev.bench.row import NotMeasuredError, Row
from crazyflie_utils.testing.launching import roslaunch

DURATION = 20.0  #: For how long it is measured, s.
#: The 99th percentile of the periods of a control that is to come every 10 ms, ms.
LONGEST_PERIOD = 12.0

_NUMBERS = range(10, 200, 10)

_START_LIMIT = 180.0

_POSITION_TIME = 3.0  #: From the service of takeoff to its call, s: vehicles first need a position.
_SETTLING = 2.0  #: From the end of the takeoff on, s.


@dataclass(frozen=True)
class SwarmFigures:
    """What a flight of some vehicles costs."""

    n: int  #: Number of vehicles.
    start: float  #: From roslaunch to the service that has them all take off, s.
    #: Processor time of their process, % of the time of the flight, which may be simulated.
    cpu: float
    #: p50, p99, longest: Periods of the final control of three of them, as they arrive outside, ms.
    p50: float
    p99: float
    longest: float
    memory: float  #: MiB.


def measure(n: int, arguments: Sequence[str] = (), core: int = 0) -> SwarmFigures:
    """Return the figures of ``n`` hovering vehicles; their process has one core.

    ``arguments`` are further ones of sw_swarm.launch.
    """
    launch = ["crazyflie_examples", "sw_swarm.launch", f"n:={n}", "rviz:=false", *arguments]
    with tempfile.TemporaryDirectory() as folder:
        begin = time.monotonic()
        with roslaunch(launch, Path(folder) / "log"):
            graph.wait_for_service("/all/takeoff", _START_LIMIT)
            start = time.monotonic() - begin
            process = graph.process_of("/fleet")
            for thread in Path(f"/proc/{process}/task").iterdir():
                # Some are there for a moment only.
                with contextlib.suppress(ProcessLookupError):
                    os.sched_setaffinity(int(thread.name), {core})
            time.sleep(_POSITION_TIME)
            graph.call("/all/takeoff")
            time.sleep(_SETTLING)
            used = graph.cpu_time([process])
            arrivals = listen(n)
            used = graph.cpu_time([process]) - used
            memory = graph.memory([process])
    stamps = [stamp for _, _, stamp in arrivals]
    p50, p99, longest = percentiles(periods(arrivals), (50, 99, 100))
    cpu = 100.0 * used / ((max(stamps) - min(stamps)) * 1e-9)
    return SwarmFigures(n, start, cpu, p50, p99, longest, memory)


def listen(n: int) -> graph.Arrivals:
    """Return the final controls of three of ``n`` vehicles within `DURATION`."""
    control = "crazyflie_msgs/ControlStamped"
    topics = (f"/cf{k}/control/final" for k in sorted({1, (n + 1) // 2, n}))
    arrivals = graph.listen(DURATION, *(("/fleet", topic, control) for topic in topics))
    if len(arrivals) < n:
        raise NotMeasuredError("no controls came")
    return arrivals


def periods(arrivals: graph.Arrivals) -> list[float]:
    """Return the periods of all topics, as they arrived, ns."""
    by_topic = ([row[1] for row in arrivals if row[0] == each] for each in {r[0] for r in arrivals})
    return [float(period) for times in by_topic for period in np.diff(times)]


def percentiles(times: Sequence[float], percents: Sequence[float]) -> list[float]:
    """Return percentiles of times in ns, ms."""
    return [float(each) * 1e-6 for each in np.percentile(times, percents)]


def vehicles_in_real_time() -> int:
    """Return how many vehicles fly such that their periods are not above `LONGEST_PERIOD`.

    In tens, found by bisection; more vehicles are taken to be slower.
    """
    position = bisect.bisect_left(_NUMBERS, True, key=lambda n: measure(n).p99 >= LONGEST_PERIOD)
    return _NUMBERS[position] - _NUMBERS.step if position < len(_NUMBERS) else _NUMBERS[-1]


ROWS = [
    Row(
        "vehicles",
        "vehicles in real time (100 Hz, p99 of the period < 12 ms), one core",
        "",
        vehicles_in_real_time,
        least=100.0,
        seconds=240.0,
    ),
]
