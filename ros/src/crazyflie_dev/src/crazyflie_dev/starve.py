"""Flies the software example while its nodes get only a share of their time.

Every node is stopped (SIGSTOP) and goes on (SIGCONT) at moments of its own, as on a computer that
is too busy. The vehicle has to stay near its hover point, or to come down.
"""

import argparse
import os
import signal
import sys
import tempfile
import time
from pathlib import Path
from random import Random

from crazyflie_dev.bench.graph import process_of
from crazyflie_dev.soak_faults import NODES
from crazyflie_reports.flight_operator import FlightError, FlightOperator
from crazyflie_utils.main import begin
from crazyflie_utils.testing.launching import roslaunch

MOST_HEIGHT = 1.5  #: The launch file's hover height, 1 m, and an overshoot, m.
_RUN = 0.035  #: Mean time for which a node runs before it is stopped (s).


def starve(pids: list[int], share: float, duration: float, seed: int) -> None:
    """Stop processes at random for ``duration`` (s), such that each has a share of the time."""
    random = Random(seed)
    changes = dict.fromkeys(pids, 0.0)
    stopped = dict.fromkeys(pids, False)
    end = time.monotonic() + duration
    try:
        while (now := time.monotonic()) < end:
            for pid in (each for each in pids if now >= changes[each]):
                stopped[pid] = not stopped[pid]
                os.kill(pid, signal.SIGSTOP if stopped[pid] else signal.SIGCONT)
                pause = _RUN * (1.0 - share) / share if stopped[pid] else _RUN
                changes[pid] = now + pause * random.uniform(0.5, 1.5)
            time.sleep(max(min(changes.values()) - time.monotonic(), 0.001))
    finally:
        for pid in pids:
            os.kill(pid, signal.SIGCONT)


def main() -> int:
    """Fly; print what was seen; exit with 1 when the vehicle was too high."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--share", type=float, default=0.3, help="of the time, for each node")
    parser.add_argument("--duration", type=float, default=60.0, help="s")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--dynamics", default="quadrotor", help="of sw_hover.launch")
    options = parser.parse_args()
    if not 0.05 <= options.share < 1.0:
        parser.error(f"--share is {options.share:g}; expected 0.05 or more, and less than 1")
    arguments = ["rviz:=false", f"dynamics:={options.dynamics}"]
    log = Path(tempfile.mkdtemp()) / "sw_hover.log"
    with roslaunch(["crazyflie_examples", "sw_hover.launch", *arguments], log):
        operator = FlightOperator(begin("starve"), limit=60.0)
        operator.wait_until_ready()
        operator.takeoff()
        try:
            starve([*map(process_of, NODES)], options.share, options.duration, options.seed)
            operator.hover(5.0)
            operator.land()
            outcome = "flown to the end"
        except FlightError as error:
            outcome = str(error)
        record = operator.finish()
    highest, last = float(record.state.values[:, 2].max()), record.state.last[2]
    print(f"highest {highest:.2f} m, last {last:.2f} m: {outcome}; log: {log}")
    return 0 if highest < MOST_HEIGHT and last < 0.05 else 1


if __name__ == "__main__":
    sys.exit(main())
