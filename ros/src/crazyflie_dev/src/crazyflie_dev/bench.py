"""Measures the running graph, and prints each figure with its goal."""

import argparse
import itertools
import json
import math
import os
import signal
import statistics
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

from crazyflie_dev import bench_flights


class Row(NamedTuple):
    """A figure, measured by a function of `bench_flights`, and its goal."""

    flight: str  #: The function, with its argument, if it has one.
    name: str  #: A word for the command line, and the key of the value.
    text: str
    unit: str
    most: float = math.inf
    least: float = -math.inf

    @property
    def goal(self) -> str:
        """The goal in words."""
        bounds = ((">=", self.least), ("<=", self.most))
        return ", ".join(f"{sign} {b:g}" for sign, b in bounds if math.isfinite(b)) or "-"


ROWS = [
    Row("hover separate", "cpu_separate", "CPU, five processes", "% of a core", 22.0),
    Row("hover separate", "memory_separate", "memory (PSS), five processes", "MiB", 190.0),
    Row("hover composed", "cpu_composed", "CPU, one process", "% of a core", 7.0),
    Row("hover composed", "memory_composed", "memory (PSS), one process", "MiB", 45.0),
    Row("journal", "journal_cpu", "journals of five processes, CPU", "% more", 5.0),
    Row("journal", "journal_size", "journals of five processes", "MiB/min", 1.0),
    Row("simulated", "simulated_time", "simulated time", "x real time", least=100.0),
    Row("simulated", "simulated_cpu", "the same per CPU time", "s/s", least=100.0),
    Row("start", "start", "from roslaunch to /takeoff, one process", "s", 1.5),
    Row("fleet 60", "fleet_60_cpu", "60 vehicles, one process, CPU", "% of a core"),
    Row("fleet 60", "fleet_60_memory", "60 vehicles, memory (PSS)", "MiB"),
    Row("fleet 100", "fleet_100_cpu", "100 vehicles, one process, CPU", "% of a core"),
    Row("fleet 100", "fleet_100_memory", "100 vehicles, memory (PSS)", "MiB"),
    Row("dashboard", "dashboard_idle", "dashboard of 100 in motion, no page", "% of a core", 1.0),
    Row("dashboard", "dashboard_page", "dashboard of 100 in motion, a page", "% of a core", 15.0),
]


def environment_of(workspace: Path) -> dict[str, str]:
    """Return the environment of a shell that has sourced this workspace only."""
    clean = {"HOME": os.environ["HOME"], "PATH": os.defpath}
    command = ["bash", "-c", f"source '{workspace.resolve()}/ros/devel/setup.bash' && env -0"]
    done = subprocess.run(command, env=clean, check=True, capture_output=True, text=True)
    return dict(line.split("=", 1) for line in done.stdout.split("\0") if line)


def measure(
    rows: list[Row], reference: dict[str, str] | None = None, rounds: int = 1
) -> Iterator[dict[str, object]]:
    """Measure, print each figure when it is known, and yield the entries of the file.

    With ``reference``, the environment of another workspace, each flight is measured there and here
    alternately, and the ratio of the means is also printed.
    """
    own = dict(os.environ)
    for flight, group in itertools.groupby(rows, lambda row: row.flight):
        function, *arguments = flight.split(" ")
        here: list[bench_flights.Figures] = []
        there: list[bench_flights.Figures] = []
        outcome: dict[str, object] = {}
        try:
            for _ in range(rounds):
                for environment, measured in ((reference, there), (own, here)):
                    if environment is not None:
                        with patch.dict(os.environ, environment, clear=True):
                            measured.append(getattr(bench_flights, function)(*arguments))
        except bench_flights.NotMeasuredError as error:
            outcome = {"reason": str(error)}
        # After any error, the other figures can still be measured.
        except Exception as error:
            reason = f"{type(error).__name__}: {error}"
            outcome = {"reason": reason, "failed": reason}
        for row in group:
            result = outcome or _compare(row, here, there)
            _print(row, result)
            yield {
                "name": row.name,
                "figure": row.text,
                "unit": row.unit,
                "goal": row.goal,
                **result,
            }


def _compare(row, here, there):
    value = statistics.mean(figures[row.name] for figures in here)
    result = {"value": value, "reached": row.least <= value <= row.most}
    if there:
        reference = statistics.mean(figures[row.name] for figures in there)
        result |= {"reference": reference, "ratio": value / reference}
    return result


def _print(row, result):
    shown = f"{row.text:40} {result.get('value', math.nan):10.4g} {row.unit:12}"
    if "reason" in result:
        shown += result["reason"]
    elif "ratio" in result:
        shown += f"{result['ratio']:6.2f} x reference, {result['reference']:.4g}"
    else:
        shown += f"goal {row.goal}{'' if result['reached'] else '  not reached'}"
    print(shown, flush=True)


def main() -> int:
    """Measure what the command line names."""
    names = ", ".join(row.name for row in ROWS)
    parser = argparse.ArgumentParser(prog="run bench", description=__doc__, epilog=f"rows: {names}")
    parser.add_argument("--out", type=Path, default=Path("out/bench.json"), help="JSON file")
    parser.add_argument(
        "--beside", type=Path, help="another workspace, measured alternately with this one"
    )
    parser.add_argument(
        "--rounds", type=int, default=1, help="number of measurements of each figure (1)"
    )
    parser.add_argument(
        "row", nargs="*", help="beginnings of rows' names, such as cpu (default: all)"
    )
    options = parser.parse_args()
    for word in options.row:
        if not any(row.name.startswith(word) for row in ROWS):
            parser.error(f"no row's name begins with {word!r}")
    rows = [row for row in ROWS if row.name.startswith(tuple(options.row) or ("",))]
    reference = environment_of(options.beside) if options.beside else None
    print(f"{len(rows)} figures; data: {options.out}", flush=True)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    # A shell's background job ignores SIGINT, and so would the launched processes, which are ended
    # by it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    results = []
    for result in measure(rows, reference, options.rounds):
        results.append(result)
        written = {"load of the last minutes": os.getloadavg(), "rows": results}
        # Finished figures survive an interruption.
        options.out.write_text(json.dumps(written, indent=2) + "\n")
    return int(any("failed" in result for result in results))


if __name__ == "__main__":
    sys.exit(main())
