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
import dataclasses
import json
import time
from pathlib import Path

from crazyflie_dev.bench import swarm


def main() -> None:
    """Measure as the command line asks, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "words",
        nargs="+",
        metavar="N",
        help="of vehicles; NAME:=VALUE is passed to sw_swarm.launch",
    )
    parser.add_argument("--core", type=int, default=0, help="that flies them (0)")
    parser.add_argument("--json", type=Path, help="write the figures there, too")
    options = parser.parse_args()
    launch = [word for word in options.words if ":=" in word]
    rows = []
    print("   n  start  cpu %   p50   p99   max ms  MiB  additions", flush=True)
    for n in [int(word) for word in options.words if word not in launch]:
        row = swarm.measure(n, launch, options.core)
        rows.append(dataclasses.asdict(row))
        print(
            f"{n:4d} {row.start:6.1f} {row.cpu:6.1f} {row.p50:5.1f} {row.p99:5.1f} "
            f"{row.longest:8.1f} {row.memory:4.0f} {_additions():6.2f}",
            flush=True,
        )
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))


def _additions():
    begin = time.process_time()
    total = 0
    for k in range(10_000_000):
        total += k
    return time.process_time() - begin


if __name__ == "__main__":
    main()
