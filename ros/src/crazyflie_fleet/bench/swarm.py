#!/usr/bin/env python
"""How many simulated vehicles one core flies; prints a line for each number of vehicles.

Run it in a shell that has sourced the workspace:

    python3 ros/src/crazyflie_fleet/bench/swarm.py 10 50 100
    python3 ros/src/crazyflie_fleet/bench/swarm.py 100 sim_time:=true real_time_factor:=0

The vehicles take off and hover, their process on one core. Periods of the final control of three
of them come from outside; the processor time comes from /proc, per second of the flight. The last
column is the processor time of ten million additions at the same moment, s: on a machine that is
busy with other work all processor times are longer. By simulated time that work does not
disturb the flight itself. Nothing is asserted.
"""

import argparse
import json
import os
import sys
import tempfile
import time
from pathlib import Path
from xmlrpc.client import ServerProxy

import numpy as np
import rosgraph
import rospy
from std_srvs.srv import Empty

from crazyflie_dev.launching import roslaunch
from crazyflie_msgs.msg import ControlStamped
from crazyflie_utils.testing.peer import wait_until

_START_LIMIT = 180.0
_TICKS = os.sysconf("SC_CLK_TCK")


def main() -> int:
    """Measure as the command line asks, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "numbers",
        nargs="+",
        type=int,
        metavar="N",
        help="of vehicles; NAME:=VALUE is passed to sw_swarm.launch",
    )
    parser.add_argument("--seconds", type=float, default=20.0, help="of hovering (20)")
    parser.add_argument("--core", type=int, default=0, help="that flies them (0)")
    parser.add_argument("--json", type=Path, help="write the figures there, too")
    options, rest = parser.parse_known_args()
    rows = []
    print("   n  start  cpu %   p50   p99   max ms  MiB  additions", flush=True)
    for n in options.numbers:
        # rospy can be initialized once in a process.
        pid = os.fork()
        if pid == 0:
            os._exit(_measure_and_print(n, options, rest))
        _, status = os.waitpid(pid, 0)
        if status:
            return 1
        rows.append(json.loads(_result_file(os.getpid()).read_text()))
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    _result_file(os.getpid()).unlink()
    return 0


def _result_file(pid):
    return Path(tempfile.gettempdir()) / f"swarm_{pid}.json"


def _measure_and_print(n, options, rest):
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "swarm.log"
        arguments = ["crazyflie_examples", "sw_swarm.launch", f"n:={n}", "rviz:=false", *rest]
        try:
            begin = time.monotonic()
            with roslaunch(arguments, log):
                row = _measure(n, options, begin)
        except Exception as error:
            print(f"{n}: {error!r}\n{log.read_text()[-2000:]}", file=sys.stderr)
            return 1
    _result_file(os.getppid()).write_text(json.dumps(row))
    line = "{n:4d} {start:6.1f} {cpu:6.1f} {p50:5.1f} {p99:5.1f} {max:8.1f} {memory:4.0f} "
    line += "{additions:6.2f}"
    print(line.format(**row), flush=True)
    return 0


def _measure(n, options, begin):
    # Only then is it decided whether time is simulated.
    wait_until(lambda: "/all/takeoff" in _services(), "the fleet", _START_LIMIT)
    rospy.init_node("swarm_bench", anonymous=True, disable_signals=True)
    start = time.monotonic() - begin
    pid = _pid("/fleet")
    os.sched_setaffinity(pid, {options.core})
    for thread in Path(f"/proc/{pid}/task").iterdir():
        os.sched_setaffinity(int(thread.name), {options.core})
    rospy.sleep(3.0)
    rospy.ServiceProxy("/all/takeoff", Empty)()
    arrivals: dict[str, list[float]] = {f"/cf{k}": [] for k in {1, (n + 1) // 2, n}}
    for name, found in arrivals.items():
        rospy.Subscriber(
            f"{name}/control/final",
            ControlStamped,
            lambda _, found=found: found.append(rospy.get_time()),
            tcp_nodelay=True,
        )
    rospy.sleep(1.0)
    for found in arrivals.values():
        found.clear()
    cpu, moment = _cpu(pid), rospy.get_time()
    rospy.sleep(options.seconds)
    share = 100.0 * (_cpu(pid) - cpu) / (rospy.get_time() - moment)
    periods = 1e3 * np.concatenate([np.diff(found) for found in arrivals.values()])
    return {
        "n": n,
        "start": start,
        "cpu": share,
        "p50": float(np.percentile(periods, 50)),
        "p99": float(np.percentile(periods, 99)),
        "max": float(periods.max()),
        "memory": _memory(pid),
        "additions": _additions(),
    }


def _additions():
    begin = time.process_time()
    total = 0
    for k in range(10_000_000):
        total += k
    return time.process_time() - begin


def _services():
    return {name for name, _ in rosgraph.Master("/swarm_bench").getSystemState()[2]}


def _pid(node):
    uri = rosgraph.Master("/swarm_bench").lookupNode(node)
    return ServerProxy(uri).getPid("/swarm_bench")[2]


def _cpu(pid):
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS


def _memory(pid):
    for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
        if line.startswith("Pss:"):
            return int(line.split()[1]) / 1024.0
    return 0.0


if __name__ == "__main__":
    sys.exit(main())
