"""Benchmark: steps of vehicles in closed loop that are computed in a second.

A step is 1 ms of one quadrotor: a rigid body of 13 states, four motors with their lag, inner loops
at 500 Hz; and, at 100 Hz, motion capture, estimator and controller. With noise, random numbers are
drawn for every pose.

Usage: python3 -m crazyflie_batch.bench [--json FILE], in a sourced workspace.
"""

import argparse
import json
import os
import time
from pathlib import Path

import numpy as np
from rospkg import RosPack

from crazyflie_batch import Controller, Measurement, quadrotor, simulate
from crazyflie_lqr.gain_file import load_matrix
from crazyflie_model.dynamics import STEP

ONE, MANY = 1, 10_000  #: Numbers of vehicles that have a goal.
DURATIONS = {ONE: 60.0, 100: 20.0, MANY: 2.0}  #: Number of vehicles -> duration of the flights (s).

GOALS = {ONE: 0.5e6, MANY: 10e6}  #: Steps per second on two processors.
REPEATS = 5


def steps_per_second(n: int, measurement: Measurement | None = None) -> tuple[float, float]:
    """Return the best of some repeats: by the clock, and by one processor's time.

    Without the time to compile. On a busy machine only the latter is meaningful. ``n`` is one of
    `DURATIONS`; without a ``measurement`` there are no errors.
    """
    controller = Controller(_gains(), integrator_k=(-0.05, 0.05, -0.5), integrator_limit=(1, 1, 6))
    model = quadrotor(mass_error=np.linspace(-0.1, 0.1, n))
    times, processor_times = [], []
    for _ in range(REPEATS + 1):
        start, processor_start = time.perf_counter(), time.process_time()
        simulate(model, controller, n=n, duration=DURATIONS[n], measurement=measurement)
        times.append(time.perf_counter() - start)
        processor_times.append(time.process_time() - processor_start)
    steps = n * DURATIONS[n] / STEP
    return steps / min(times[1:]), steps / min(processor_times[1:])


def _gains():
    return load_matrix(str(Path(RosPack().get_path("crazyflie_lqr"), "config", "K_soft.txt")), 4, 7)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
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
        count, goal, *values = row.values()
        numbers = "".join(f"{value:>14,.0f}" for value in values)
        print(f"{count:>12,}{numbers}{f'{goal:,.0f}' if goal else '-':>12}")
    print(f"on {result['processors']} processors, load {result['load']:.1f}")
    if options.json:
        Path(options.json).write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
