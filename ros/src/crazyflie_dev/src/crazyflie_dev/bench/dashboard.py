"""What the dashboard costs a hundred vehicles in flight: without a page, and with one."""

import functools
import tempfile
import time
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np

from crazyflie_dev.bench import graph, swarm
from crazyflie_dev.bench.page_client import PageClient
from crazyflie_dev.bench.row import NotMeasuredError, Row
from crazyflie_utils.testing.launching import roslaunch

_VEHICLES = 100
_START_LIMIT = 180.0
_SETTLING = 10.0  #: Until vehicles have a position, hover, and are found by a page, s.
_ROUNDS = 3
_SHARE = 55.0  #: Of each row in the time that it takes to measure all, s.
_URL = "http://127.0.0.1:8642"

#: While it is measured, all vehicles move by so much, m, in this time, s: of a fleet that hovers a
#: page is sent nothing.
_CLIMB, _DURATION = 0.5, round(swarm.DURATION) + 10

_LEAST_RATE = 15.0  #: Scenes that come in a s; the page sends 20 of vehicles in motion.


@dataclass(frozen=True)
class DashboardFigures:
    """What is measured beside a flight."""

    cpu: float  #: Processor time of the dashboard's process, % of a core.
    #: period, latency: 99th percentiles of the final control, as it arrives outside, ms; the
    #: latency is from the stamp of its pose on.
    period: float
    latency: float


@functools.cache
def measure() -> tuple[DashboardFigures, DashboardFigures]:
    """Return figures of a fleet in motion: without a page, and with one.

    Means of measurements that alternate, for a fleet's first minute is not like its second. The
    page is that of another computer: what drawing it costs is not the flight's.
    """
    without_page, with_page = [], []
    fleet = ["crazyflie_examples", "sw_swarm.launch", f"n:={_VEHICLES}", "rviz:=false"]
    with tempfile.TemporaryDirectory() as folder:
        with roslaunch([*fleet, "dashboard:=true"], Path(folder) / "log"):
            graph.wait_for_service("/all/takeoff", _START_LIMIT)
            graph.wait_for_service("/dashboard/get_loggers", _START_LIMIT)
            time.sleep(_SETTLING)
            graph.call("/all/takeoff")
            for _ in range(_ROUNDS):
                time.sleep(_SETTLING)
                without_page.append(_figures(_CLIMB))
                with PageClient(_URL) as page:
                    time.sleep(_SETTLING)
                    with_page.append(_figures(-_CLIMB, page))
    return _mean(without_page), _mean(with_page)


def _mean(measured: list[DashboardFigures]) -> DashboardFigures:
    return DashboardFigures(*np.mean([astuple(each) for each in measured], axis=0).tolist())


def _figures(climb: float, page: PageClient | None = None) -> DashboardFigures:
    move = f"{{relative: true, goal: {{z: {climb}}}, duration: {{secs: {_DURATION}}}}}"
    graph.call("/all/go_to", move)
    process = graph.process_of("/dashboard")
    scenes = page.scenes if page else 0
    used, began = graph.cpu_time([process]), time.monotonic()
    arrivals = swarm.listen(_VEHICLES)
    duration = time.monotonic() - began
    cpu = 100.0 * (graph.cpu_time([process]) - used) / duration
    if page and (rate := (page.scenes - scenes) / duration) < _LEAST_RATE:
        raise NotMeasuredError(f"{rate:.1f} scenes a s have come; expected {_LEAST_RATE:g} or more")
    (period,) = swarm.percentiles(swarm.periods(arrivals), [99])
    latencies = [arrival - stamp for _, arrival, stamp in arrivals]
    return DashboardFigures(cpu, period, *swarm.percentiles(latencies, [99]))


# From one measurement to the next the figures differ by 1 ms.
def _rise(figure: str) -> float:
    without_page, with_page = (getattr(each, figure) for each in measure())
    return float(with_page - without_page)


ROWS = [
    Row(
        "dashboard_idle",
        f"dashboard beside {_VEHICLES} vehicles in motion, no page open",
        "% of a core",
        lambda: measure()[0].cpu,
        most=1.0,
        seconds=_SHARE,
    ),
    Row(
        "dashboard_page",
        f"dashboard beside {_VEHICLES} vehicles in motion, a page open",
        "% of a core",
        lambda: measure()[1].cpu,
        most=15.0,
        seconds=_SHARE,
    ),
    Row(
        "dashboard_period",
        f"{_VEHICLES} vehicles in motion: p99 of the control's period with a page, minus without",
        "ms",
        lambda: _rise("period"),
        most=1.0,
        seconds=_SHARE,
    ),
    Row(
        "dashboard_latency",
        f"{_VEHICLES} vehicles in motion: p99 of pose -> control with a page, minus without",
        "ms",
        lambda: _rise("latency"),
        most=1.0,
        seconds=_SHARE,
    ),
]
