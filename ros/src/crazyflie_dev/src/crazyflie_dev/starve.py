"""Flies the software example while its nodes get only a share of their time.

Every node is stopped (SIGSTOP) and goes on (SIGCONT) at moments of its own, as on a computer that
is too busy; or all together get a quota of a core by a Linux control group, as in a container. The
vehicle has to stay near its hover point, or to come down. Run
``python3 -m crazyflie_dev.starve --share 0.3``, or ``--quota 0.1`` as root.
"""

import argparse
import os
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random
from typing import Any
from xmlrpc.client import ServerProxy

import rosgraph

from crazyflie_dev.soak_faults import NODES
from crazyflie_reports.flight_operator import FlightError, FlightOperator
from crazyflie_utils.main import begin
from crazyflie_utils.testing.launching import roslaunch

HOVER_HEIGHT = 1.0  #: Of the launch file, m.
OVERSHOOT = 0.5  #: How far above it the vehicle may come, m.
_RUN = 0.035  #: How long a node runs on average before it is stopped, s.


def process_ids(names: tuple[str, ...]) -> list[int]:
    """Return the process ids of nodes."""
    master = rosgraph.Master("/starve")
    replies: list[Any] = [ServerProxy(master.lookupNode(name)).getPid("/starve") for name in names]
    return [pid for _, _, pid in replies]


def starve(pids: list[int], share: float, duration: float, seed: int) -> None:
    """Stop processes at random for ``duration`` (s), such that each has a share of the time."""
    random = Random(seed)
    stopped: set[int] = set()
    changes = dict.fromkeys(pids, 0.0)
    end = time.monotonic() + duration
    try:
        while (now := time.monotonic()) < end:
            for pid in pids:
                if now < changes[pid]:
                    continue
                if pid in stopped:
                    stopped.remove(pid)
                    os.kill(pid, signal.SIGCONT)
                    pause = _RUN
                else:
                    stopped.add(pid)
                    os.kill(pid, signal.SIGSTOP)
                    pause = _RUN * (1.0 - share) / share
                changes[pid] = now + pause * random.uniform(0.5, 1.5)
            time.sleep(max(min(changes.values()) - time.monotonic(), 0.001))
    finally:
        for pid in stopped:
            os.kill(pid, signal.SIGCONT)


_GROUPS = Path("/sys/fs/cgroup")
#: In which a quota counts, microseconds: what Linux and container engines take by default.
_PERIOD = 100_000


@contextmanager
def limited(pids: list[int], quota: float) -> Iterator[None]:
    """Give processes together a quota of a core, by control groups of version 1 or 2.

    OSError: the system does not allow it, by permission or without a controller of the CPU.
    """
    has_version_1 = (_GROUPS / "cpu").is_dir()
    parent = _GROUPS / "cpu" if has_version_1 else _GROUPS
    group = parent / f"starve_{os.getpid()}"
    group.mkdir()
    try:
        share = round(quota * _PERIOD)
        if has_version_1:
            (group / "cpu.cfs_period_us").write_text(str(_PERIOD))
            (group / "cpu.cfs_quota_us").write_text(str(share))
        else:
            (parent / "cgroup.subtree_control").write_text("+cpu")
            (group / "cpu.max").write_text(f"{share} {_PERIOD}")
        for pid in pids:
            (group / "cgroup.procs").write_text(str(pid))
        yield
    finally:
        for member in (group / "cgroup.procs").read_text().split():
            (parent / "cgroup.procs").write_text(member)
        group.rmdir()


def main() -> int:
    """Fly; print what was seen; exit with 1 when the vehicle was too high."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--share", type=float, default=0.3, help="of the time, for each node")
    parser.add_argument("--quota", type=float, help="of a core, for all nodes, in place of a share")
    parser.add_argument("--duration", type=float, default=60.0, help="s")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--dynamics", default="quadrotor", help="of sw_hover.launch")
    options = parser.parse_args()
    if not 0.05 <= options.share < 1.0:
        parser.error(f"--share is {options.share:g}; expected 0.05 or more, and less than 1")
    if options.quota is not None and not 0.01 <= options.quota <= 1.0:
        parser.error(f"--quota is {options.quota:g}; expected 0.01 to 1")
    arguments = ["rviz:=false", f"dynamics:={options.dynamics}"]
    log = Path(tempfile.mkdtemp()) / "sw_hover.log"
    with roslaunch(["crazyflie_examples", "sw_hover.launch", *arguments], log):
        operator = FlightOperator(begin("starve"), limit=60.0)
        operator.wait_until_ready()
        operator.takeoff()
        pids = process_ids(NODES)
        try:
            if options.quota is None:
                starve(pids, options.share, options.duration, options.seed)
            else:
                with limited(pids, options.quota):
                    operator.hover(options.duration)
            operator.hover(5.0)
            operator.land()
            outcome = "flown to the end"
        except FlightError as error:
            outcome = str(error)
        record = operator.finish()
    highest = float(record.state.values[:, 2].max())
    print(f"highest {highest:.2f} m, last {record.state.last[2]:.2f} m: {outcome}; log: {log}")
    is_good = highest < HOVER_HEIGHT + OVERSHOOT and record.state.last[2] < 0.05
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
