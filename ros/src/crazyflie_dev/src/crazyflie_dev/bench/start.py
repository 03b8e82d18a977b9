"""How long a launch takes."""

import statistics
import tempfile
import time
from pathlib import Path

from crazyflie_dev.bench import graph
from crazyflie_dev.bench.row import Row
from crazyflie_utils.testing.launching import roslaunch

REPEATS = 3


def _start_time():
    """Return how long it takes from roslaunch to /takeoff, s; the first one warms up."""
    times = []
    for _ in range(1 + REPEATS):
        with tempfile.TemporaryDirectory() as folder:
            arguments = ["crazyflie_examples", "sw_hover.launch", "rviz:=false", "composed:=true"]
            begin = time.monotonic()
            with roslaunch(arguments, Path(folder) / "log"):
                graph.wait_for_service("/takeoff")
                times.append(time.monotonic() - begin)
    return statistics.median(times[1:])


ROWS = [Row("start", "from roslaunch to /takeoff, one process", "s", _start_time, most=1.5)]
