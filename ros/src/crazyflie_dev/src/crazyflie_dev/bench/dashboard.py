"""What the dashboard costs beside a hundred vehicles: without a page, and with one."""

import functools
import shutil
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from crazyflie_dev.bench import graph
from crazyflie_dev.bench.row import NotMeasuredError, Row
from crazyflie_utils.testing.launching import roslaunch

_VEHICLES = 100
_DURATION = 15.0  #: Of each measurement, s.
_START_LIMIT = 180.0
_SETTLING = 10.0  #: From the start of the page until it has found and drawn all vehicles, s.
_URL = "http://127.0.0.1:8642/"


@dataclass(frozen=True)
class DashboardFigures:
    """Processor time of the dashboard's process, % of a core."""

    without_page: float
    with_page: float


@functools.cache
def measure() -> DashboardFigures:
    """Return what the dashboard costs beside a fleet on the ground, whose poses come as in flight.

    Raises `NotMeasuredError` without Chromium.
    """
    browser = shutil.which("chromium")
    if browser is None:
        raise NotMeasuredError("there is no chromium")
    fleet = ["crazyflie_examples", "sw_swarm.launch", f"n:={_VEHICLES}", "rviz:=false"]
    with tempfile.TemporaryDirectory() as folder:
        with roslaunch([*fleet, "dashboard:=true"], Path(folder) / "log"):
            graph.wait_for_service("/all/takeoff", _START_LIMIT)
            graph.wait_for_service("/dashboard/get_loggers", _START_LIMIT)
            time.sleep(_SETTLING)
            process = graph.process_of("/dashboard")
            without_page = _share(process)
            page = subprocess.Popen(
                ["nice", "-n", "19", browser, "--headless=new", "--no-sandbox"]
                + ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
                + [f"--user-data-dir={folder}/profile", "--remote-debugging-port=0", _URL],
                stderr=subprocess.DEVNULL,
            )
            try:
                time.sleep(_SETTLING)
                return DashboardFigures(without_page, _share(process))
            finally:
                page.terminate()
                page.wait(10.0)


def _share(process):
    used, began = graph.cpu_time([process]), time.monotonic()
    time.sleep(_DURATION)
    return 100.0 * (graph.cpu_time([process]) - used) / (time.monotonic() - began)


ROWS = [
    Row(
        "dashboard_idle",
        f"dashboard beside {_VEHICLES} vehicles, no page open",
        "% of a core",
        lambda: measure().without_page,
        most=1.0,
    ),
    Row(
        "dashboard_page",
        f"dashboard beside {_VEHICLES} vehicles, a page open",
        "% of a core",
        lambda: measure().with_page,
        most=15.0,
    ),
]
