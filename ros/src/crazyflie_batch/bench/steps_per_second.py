"""Measure closed-loop vehicle steps per second, for one vehicle, a hundred, and ten thousand.

Usage: python3 bench/steps_per_second.py [--json FILE], in a sourced workspace.

A step is 1 ms of one quadrotor: a rigid body of 13 states, four motors with their lag, inner loops
at 500 Hz; and, at 100 Hz, motion capture, estimator and controller. "Noise" has every pose drawn
with errors of its own; "one by one" flies by the classes that the nodes have.
"""

import argparse
import json
import os
import time
from pathlib import Path

import numpy as np
from rospkg import RosPack

from crazyflie_batch import Controller, FiniteDifferences, Measurement, quadrotor, simulate
from crazyflie_batch.scalar import fly_one
from crazyflie_batch.simulation import prepare
from crazyflie_lqr.gain_file import load_matrix
from crazyflie_model.dynamics import STEP

DURATIONS = {1: 60.0, 100: 20.0, 10_000: 2.0}
"""Of the flights, s, by number of vehicles."""

GOALS = {1: 0.5e6, 10_000: 10e6}
"""Steps per second on two processors."""

REPEATS = 5


def steps_per_second(n: int, measurement: Measurement) -> float:
    """Return the best of some repeats; what is compiled is compiled before."""
    controller = Controller(_gains(), integrator_k=(-0.05, 0.05, -0.5), integrator_limit=(1, 1, 6))
    model = quadrotor(mass_error=np.linspace(-0.1, 0.1, n))
    times = []
    for _ in range(REPEATS + 1):
        start = time.perf_counter()
        simulate(model, controller, n=n, duration=DURATIONS[n], measurement=measurement)
        times.append(time.perf_counter() - start)
    return n * DURATIONS[n] / STEP / min(times[1:])


def one_by_one() -> float:
    """Return the same of the nodes' classes."""
    duration = 2.0
    batch = prepare(
        quadrotor(),
        Controller(_gains()),
        FiniteDifferences(),
        (0.0, 0.0, 1.0),
        1,
        goal=(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0),
        duration=duration,
        period=0.01,
        settle_time=0.0,
        measurement=Measurement(),
        seed=0,
        first=0,
    )
    start = time.perf_counter()
    fly_one(batch, 0)
    return duration / STEP / (time.perf_counter() - start)


def _gains():
    return load_matrix(str(Path(RosPack().get_path("crazyflie_lqr"), "config", "K_soft.txt")), 4, 7)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", metavar="FILE", help="also write the figures to a file")
    options = parser.parse_args()
    noise = Measurement(1e-4, 1e-3)
    rows = [
        {
            "vehicles": n,
            "goal": GOALS.get(n),
            "steps_per_second": steps_per_second(n, Measurement()),
            "steps_per_second_with_noise": steps_per_second(n, noise),
        }
        for n in DURATIONS
    ]
    result = {
        "processors": len(os.sched_getaffinity(0)),
        "load": os.getloadavg()[0],
        "batch": rows,
        "one_by_one": one_by_one(),
    }
    print(f"{'vehicles':>12}{'steps/s':>14}{'with noise':>14}{'goal':>12}")
    for row in rows:
        goal = f"{row['goal']:,.0f}" if row["goal"] else "-"
        print(
            f"{row['vehicles']:>12,}{row['steps_per_second']:>14,.0f}"
            f"{row['steps_per_second_with_noise']:>14,.0f}{goal:>12}"
        )
    print(f"{'one by one':>12}{result['one_by_one']:>14,.0f}")
    print(f"on {result['processors']} processors, load {result['load']:.1f}")
    if options.json:
        Path(options.json).write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
