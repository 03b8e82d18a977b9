"""Fly a launch file and print, as JSON, the modules that its processes import in the flight.

Usage: imports_in_flight.py PACKAGE FILE [ARGUMENT:=VALUE ...] -- NAME ...

The vehicles take off, go to a place, follow a trajectory and land. Python itself reports each
import of each process in the output of roslaunch.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import rosnode

from crazyflie_demo.figure8 import figure8
from crazyflie_mission_api import Fleet, Limits
from crazyflie_utils.testing.launching import roslaunch

_IMPORT = re.compile(r"^import time: +\d+ \| +\d+ \| +([\w.]+)", re.MULTILINE)
_ENDED = re.compile(r"\[([\w/]+)-\d+\] process has finished cleanly")
_LIMITS = Limits(speed=1.0, acceleration=1.5)  #: Those of the trajectory are below.
_START_LIMIT = 60.0  #: The nodes have started after this time (s).
_STARTED = {"rospy", "numpy"}  #: Each process has imported them when it is up.


def imports(log: Path) -> list[str]:
    """Return what the processes have imported so far."""
    return _IMPORT.findall(log.read_text(errors="replace"))


def ended(log: Path) -> list[str]:
    """Return the nodes that have done their work and ended."""
    return [f"/{name}" for name in _ENDED.findall(log.read_text(errors="replace"))]


def wait_for_nodes(launch: list[str], log: Path) -> None:
    """Wait until each node of a launch file has started, and so has imported its modules."""
    listed = subprocess.run(
        ["roslaunch", "--nodes", *launch], capture_output=True, text=True, check=True
    )
    missing = set(listed.stdout.split())
    deadline = time.monotonic() + _START_LIMIT
    while missing := missing - {*rosnode.get_node_names(), *ended(log)}:
        if time.monotonic() > deadline:
            raise TimeoutError(f"after {_START_LIMIT} s {sorted(missing)} have not started")
        time.sleep(0.1)


def mission(fleet: Fleet) -> None:
    """Use each kind of command once."""
    fleet.takeoff(0.8)
    fleet.go_to((0.2, 0.1, 0.1), relative=True)
    fleet.follow(dict.fromkeys(fleet.names, figure8()), relative=True)
    fleet.land()


def main(launch: list[str], names: list[str]) -> dict[str, list[str]]:
    """Fly; return what was imported until the vehicles were ready, and in the flight."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "launch.log"
        os.environ["PYTHONPROFILEIMPORTTIME"] = os.environ["PYTHONUNBUFFERED"] = "1"
        with roslaunch(launch, log), Fleet(names, limits=_LIMITS) as fleet:
            fleet.dry_run(mission)
            wait_for_nodes(launch, log)
            before = imports(log)
            mission(fleet)
            after = imports(log)
    return {"before": sorted({*before} & _STARTED), "in flight": after[len(before) :]}


if __name__ == "__main__":
    split = sys.argv.index("--")
    print(json.dumps(main(sys.argv[1:split], sys.argv[split + 1 :])))
