"""Measures the running graph, and prints each figure beside its goal."""

import argparse
import json
import os
import platform
import sys
from collections.abc import Iterator
from pathlib import Path

from crazyflie_dev.bench import batch, dashboard, hover, machine, simulated, start, swarm
from crazyflie_dev.bench.row import NotMeasuredError, Row

_PARTS = (machine, hover, simulated, start, swarm, batch, dashboard)

ROWS = [row for part in _PARTS for row in part.ROWS]


def measure(rows: list[Row]) -> Iterator[dict[str, object]]:
    """Measure, print each figure when it is there, and yield what is written to the file."""
    width = max(len(row.text) for row in rows)
    for row in rows:
        result: dict[str, object] = {"name": row.name, "figure": row.text, "unit": row.unit}
        result["goal"] = row.goal
        try:
            value = row.measure()
        except NotMeasuredError as reason:
            result["reason"] = str(reason)
        # Whatever it is, the other figures can still be had.
        except Exception as error:
            result["reason"] = result["failed"] = f"{type(error).__name__}: {error}"
        else:
            result |= {"value": value, "reached": row.is_reached(value)}
            mark = "" if row.is_reached(value) else "  not reached"
            shown = f"{value:10.4g} {row.unit:12} goal {row.goal}{mark}"
        if "reason" in result:
            shown = f"{'-':>10} {row.unit:12} {result['reason']}"
        print(f"{row.text:{width}} {shown}", flush=True)
        yield result


def write(path: Path, results: list[dict[str, object]]) -> None:
    """Write results as JSON."""
    about = {
        "processor": platform.machine(),
        "cores": os.cpu_count(),
        "load of the last minutes": os.getloadavg()[2],
    }
    path.write_text(json.dumps({"machine": about, "rows": results}, indent=2) + "\n")


def main() -> int:
    """Measure what the command line names."""
    parser = argparse.ArgumentParser(
        prog="run bench", description=__doc__, epilog=f"rows: {', '.join(r.name for r in ROWS)}"
    )
    parser.add_argument("--out", type=Path, default=Path("out/bench.json"), help="JSON file")
    parser.add_argument("row", nargs="*", help="beginnings of rows' names, such as cpu; all")
    options = parser.parse_args()
    unknown = [each for each in options.row if not any(r.name.startswith(each) for r in ROWS)]
    if unknown:
        parser.error(f"no row's name begins with {unknown[0]!r}")
    chosen = tuple(options.row) or ("",)
    rows = [row for row in ROWS if row.name.startswith(chosen)]
    minutes = sum(row.seconds for row in rows) / 60.0
    print(f"{len(rows)} figures, about {minutes:.0f} min; data: {options.out}", flush=True)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    results = []
    for result in measure(rows):
        results.append(result)
        # What there is outlasts an interruption.
        write(options.out, results)
    print(f"data: {options.out}")
    return int(any("failed" in result for result in results))


if __name__ == "__main__":
    sys.exit(main())
