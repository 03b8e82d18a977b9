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

from crazyflie_dev.bench import flights
from crazyflie_dev.bench.graph import NotMeasuredError

_HOVER_FIGURES = [
    ("cpu", "CPU of the graph", "% of a core"),
    ("cpu_watched", "the same with listeners outside", "% of a core"),
    ("memory", "memory (PSS)", "MiB"),
    ("latency_p50", "state to final control, outside, p50", "ms"),
    ("latency_p99", "state to final control, outside, p99", "ms"),
    ("tf_rate", "rate of /tf", "Hz"),
    ("pose_p50", "stamp of the pose to final control, p50", "ms"),
]


class Row(NamedTuple):
    """A figure, which a function of `flights` measures, and its goal."""

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


def _hover(name, text, **most):
    return [
        Row(f"hover {name}", f"{key}_{name}", f"{words}, {text}", unit, most.get(key, math.inf))
        if key != "tf_rate"
        else Row(f"hover {name}", f"{key}_{name}", f"{words}, {text}", unit, 1001.0, 999.0)
        for key, words, unit in _HOVER_FIGURES
    ]


def _simulated(name, text, least):
    flight = f"simulated {name}"
    return [
        Row(flight, f"simulated_time{name}", f"simulated time, {text}", "x real time", least=least),
        Row(flight, f"simulated_cpu{name}", f"the same per CPU time, {text}", "s/s", least=least),
    ]


def _fleet(n):
    return [
        Row(f"fleet {n}", f"fleet_{n}_cpu", f"{n} vehicles, one process, CPU", "% of a core"),
        Row(f"fleet {n}", f"fleet_{n}_period", f"{n} vehicles, p99 of the period", "ms", 12.0),
        Row(f"fleet {n}", f"fleet_{n}_memory", f"{n} vehicles, memory (PSS)", "MiB"),
    ]


ROWS = [
    Row("machine", "machine", "an empty loop of 10 ms, p99 of the period", "ms"),
    *_hover("separate", "five processes", cpu=22.0, memory=190.0),
    *_hover("composed", "one process", cpu=7.0, memory=45.0, latency_p50=0.15, latency_p99=0.4),
    *_hover("arrival", "one process, on arrival", pose_p50=1.0),
    *_simulated("", "without a listener", 100.0),
    *_simulated("_watched", "with a listener on /clock", 40.0),
    Row("start", "start", "from roslaunch to /takeoff, one process", "s", 1.5),
    *_fleet(60),
    *_fleet(100),
    Row("vehicles", "vehicles", "vehicles in real time, p99 of the period < 12 ms", "", least=100),
    Row("batch", "batch_many", "batch, n = 10 000: steps of 13 states", "1/s", least=10e6),
    Row("batch", "batch_one", "batch, n = 1: steps of 13 states", "1/s", least=500e3),
    Row("dashboard", "dashboard_idle", "dashboard of 100 in motion, no page", "% of a core", 1.0),
    Row("dashboard", "dashboard_page", "dashboard of 100 in motion, a page", "% of a core", 15.0),
    Row("dashboard", "dashboard_period", "p99 of the period with a page, minus without", "ms", 1.0),
    Row("dashboard", "dashboard_latency", "p99 of pose to control, minus without", "ms", 1.0),
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
    """Measure, print each figure when it is there, and yield what is written to the file.

    With ``reference``, the environment of another workspace, each flight is measured there and
    here in turns, and the ratio of the means is printed, too.
    """
    own = dict(os.environ)
    for flight, group in itertools.groupby(rows, lambda row: row.flight):
        function, *arguments = flight.split(" ")
        here: list[flights.Figures] = []
        there: list[flights.Figures] = []
        outcome: dict[str, object] = {}
        try:
            for _ in range(rounds):
                for environment, measured in ((reference, there), (own, here)):
                    if environment is not None:
                        os.environ.clear()
                        os.environ.update(environment)
                        measured.append(getattr(flights, function)(*arguments))
        except NotMeasuredError as error:
            outcome = {"reason": str(error)}
        # Whatever it is, the other figures can still be had.
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
    shown = f"{row.text:55} {result.get('value', math.nan):10.4g} {row.unit:12}"
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
    parser.add_argument("--beside", type=Path, help="another workspace, measured in turns with it")
    parser.add_argument("--rounds", type=int, default=1, help="how often each is measured (1)")
    parser.add_argument("row", nargs="*", help="beginnings of rows' names, such as cpu; all")
    options = parser.parse_args()
    for word in options.row:
        if not any(row.name.startswith(word) for row in ROWS):
            parser.error(f"no row's name begins with {word!r}")
    rows = [row for row in ROWS if row.name.startswith(tuple(options.row) or ("",))]
    reference = environment_of(options.beside) if options.beside else None
    print(f"{len(rows)} figures; data: {options.out}", flush=True)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    # A shell's background job ignores it, and so would what is launched, and ended by it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    results = []
    for result in measure(rows, reference, options.rounds):
        results.append(result)
        written = {"load of the last minutes": os.getloadavg(), "rows": results}
        # What there is outlasts an interruption.
        options.out.write_text(json.dumps(written, indent=2) + "\n")
    return int(any("failed" in result for result in results))


if __name__ == "__main__":
    sys.exit(main())
