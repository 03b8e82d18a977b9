"""Measure closed-loop vehicle steps per second, for one vehicle, a hundred, and ten thousand.

Usage: python3 bench/steps_per_second.py [--json FILE], in a sourced workspace.

Steps are defined in `crazyflie_batch.bench`. With noise, random numbers are drawn for every pose.
"""

import argparse
import json
import os
from pathlib import Path

from crazyflie_batch import Measurement
from crazyflie_batch.bench import DURATIONS, MANY, ONE, steps_per_second

GOALS = {ONE: 0.5e6, MANY: 10e6}  #: Steps per second on two processors.


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", metavar="FILE", help="also write the figures to a file")
    options = parser.parse_args()
    noise = Measurement(1e-4, 1e-3)
    rows = []
    for n in DURATIONS:
        by_clock, by_processor = steps_per_second(n)
        noisy, noisy_by_processor = steps_per_second(n, noise)
        rows.append(
            {
                "vehicles": n,
                "goal": GOALS.get(n),
                "steps_per_second": by_clock,
                "steps_per_second_with_noise": noisy,
                "steps_per_processor_second": by_processor,
                "steps_per_processor_second_with_noise": noisy_by_processor,
            }
        )
    result = {
        "processors": len(os.sched_getaffinity(0)),
        "load": os.getloadavg()[0],
        "batch": rows,
    }
    print(f"{'':>12}{'steps per second':>28}{'of one processor':>28}")
    print(f"{'vehicles':>12}{'':>14}{'with noise':>14}{'':>14}{'with noise':>14}{'goal':>12}")
    for row in rows:
        n, goal, *values = row.values()
        numbers = "".join(f"{value:>14,.0f}" for value in values)
        print(f"{n:>12,}{numbers}{f'{goal:,.0f}' if goal else '-':>12}")
    print(f"on {result['processors']} processors, load {result['load']:.1f}")
    if options.json:
        Path(options.json).write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
