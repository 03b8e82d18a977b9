"""Reports on the flights of bags: a page for a browser, tables as CSV and JSON."""

import argparse
import csv
import json
import math
import re
import shutil
import sys
import tempfile
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from crazyflie_reports import bag_log, bag_mcap, laid_over, report_page
from crazyflie_reports.bag_file import BagError
from crazyflie_reports.bag_flights import flights, vehicle_namespaces
from crazyflie_reports.bag_topics import ROLES
from crazyflie_reports.figures import Figure, figures
from crazyflie_reports.usd_overlay import lay_over
from crazyflie_utils.text_file import user_path

PAGE, FIGURES, EVENTS, DATA = "report.html", "figures.csv", "events.csv", "report.json"
MCAP = "mcap"  #: Folder of the recordings as MCAP.

#: First characters by which spreadsheets take a cell for a formula.
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


class ReportError(Exception):
    """No recording can be read, or the report cannot be written; the text says why."""


class Report:
    """A report on recordings, to which recordings are added."""

    def __init__(self) -> None:
        self.recordings: list[dict[str, Any]] = []  #: As `report_page.page` takes them.
        self._flights: list[tuple[dict[str, Any], list[Figure]]] = []

    def add(self, log: bag_log.BagLog) -> None:
        """Add the flights of a recording."""
        points = report_page.points_of(len(vehicle_namespaces(log)))
        data = []
        for flight in flights(log):
            found = figures(flight)
            data.append(report_page.flight_data(flight, found, points))
            entry = {
                **{"recording": log.name, "vehicle": flight.vehicle.name, "flight": flight.number},
                "phases": data[-1]["phases"],
                "events": flight.event_rows(),
            }
            self._flights.append((entry, found))
        start = f"{datetime.fromtimestamp(log.start, UTC):%Y-%m-%d %H:%M:%S} UTC"
        if log.is_on_board:
            start = "in time since the vehicle was switched on"
        elif log.start <= bag_log.SIMULATED:
            start = "in simulated time"
        self.recordings.append(
            {
                "name": log.name,
                "start": start,
                "duration": round(log.end - log.start, 3),
                "remarks": log.remarks if data else [*log.remarks, *_why_there_is_no_flight(log)],
                "flights": data,
            }
        )

    def write(self, folder: Path) -> None:
        """Write page and tables into a folder, which is created if it does not exist."""
        names = [[f.name, f.unit, f.needs, f.note] for _, row in self._flights[:1] for f in row]
        folder.mkdir(parents=True, exist_ok=True)
        (folder / PAGE).write_text(report_page.page(self.recordings, names))
        keys = ["recording", "vehicle", "flight"]
        figure_rows: list[list[Any]] = [[*keys, "figure", "value", "unit", "normal", "is normal"]]
        event_rows: list[list[Any]] = [[*keys, "time (s)", "kind", "text", "count"]]
        tables = []
        for entry, found in self._flights:
            key, values = [entry[each] for each in keys], {}
            for f in found:
                number = f.value if math.isfinite(f.value) else None
                is_normal = None if math.isnan(f.value) else f.is_normal
                figure_rows.append([*key, f.name, number, f.unit, f.normal, is_normal])
                values[f.name] = {"value": number, "unit": f.unit, "normal": f.normal}
            event_rows += [[*key, *event] for event in entry["events"]]
            tables.append({**entry, "figures": values})
        _write_csv(folder / FIGURES, figure_rows)
        _write_csv(folder / EVENTS, event_rows)
        (folder / DATA).write_text(json.dumps(tables, indent=1, allow_nan=False))

    def table(self) -> str:
        """Return a line for each flight, with the abnormal figures."""
        lines = []
        for entry, found in self._flights:
            bad = [
                f"{f.name} {f.value:.4g} {f.unit} ({f.normal})" for f in found if not f.is_normal
            ]
            flight = f"{entry['recording']}: {entry['vehicle']}, flight {entry['flight']}"
            lines.append(f"{flight}: {', '.join(bad) or 'normal'}")
        return "\n".join(lines)


def make(
    paths: list[Path],
    folder: Path,
    names: dict[str, str] | None = None,
    has_mcap: bool = False,
    compares: bool = False,
) -> list[str]:
    """Write a report on recordings; return the errors.

    A path is a bag, a folder of bags that follow each other, or a log of a vehicle's micro SD card,
    which is added to the bag that it matches; for ``names`` see `bag_log.read`. With ``has_mcap``
    each recording is also written as MCAP; with ``compares`` flights of two recordings are laid
    over each other. `ReportError`: none of the recordings can be read, or
    the folder cannot be written.
    """
    report, problems, written = Report(), [], []
    own_names = [bag_log.name_of(each) for each in paths]
    logs: list[bag_log.BagLog] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        # Next to the report, since /tmp may be in memory.
        with tempfile.TemporaryDirectory(dir=folder) as place:
            for path, name in zip(paths, own_names, strict=True):
                try:
                    found = bag_log.read(path, Path(tempfile.mkdtemp(dir=place)), names)
                except BagError as error:
                    problems.append(str(error))
                    continue
                for log in found:
                    # Bags in different folders may have the same name.
                    if own_names.count(name) > 1:
                        log.name = str(path) + log.name.removeprefix(name)
                logs += found
            bags = [log for log in logs if not log.is_on_board]
            alone = [log for log in logs if log.is_on_board and not lay_over(log, bags)]
            for log in [*bags, *alone]:
                report.add(log)
                if has_mcap:
                    written.append(bag_mcap.write(log, _new_folder(folder / MCAP, log.name)))
        if not report.recordings:
            raise ReportError("\n".join(problems))
        if compares and len(report.recordings) == 2:
            laid_over.lay_over(report.recordings, is_same_time=False)
        report.write(folder)
    except OSError as error:
        raise ReportError(f"the report cannot be written into {folder}: {error.strerror}") from None
    print(report.table())
    for recording in report.recordings:
        print("".join(f"{remark}\n" for remark in recording["remarks"]), end="")
    print(*(f"mcap: {each}" for each in written), f"report: {folder / PAGE}", sep="\n")
    return problems


def main() -> int:
    """Make a report by the command line; return the exit status."""
    roles = sorted({each.name for each in ROLES})
    parser = argparse.ArgumentParser(prog="flight_report", description=__doc__)
    parser.add_argument(
        "bags",
        nargs="+",
        type=user_path,
        metavar="BAG",
        help="bag of ROS 1 or ROS 2 (*.mcap, *.db3), or a folder of consecutive bags; or a log "
        "of a vehicle's micro SD card, which is added to the bag that it matches",
    )
    parser.add_argument(
        "--out",
        type=user_path,
        default=Path("flight_report"),
        help="folder of the report (%(default)s)",
    )
    parser.add_argument(
        "--topic", action="append", default=[], metavar="ROLE=NAME",
        help=f"other name of a topic, below the vehicle's namespace; roles: {', '.join(roles)}",
    )  # fmt: skip
    parser.add_argument(
        "--mcap", action="store_true", help="also write recordings for Foxglove and Lichtblick"
    )
    parser.add_argument(
        "--compare", action="store_true", help="lay flights of two recordings over each other"
    )
    options = parser.parse_args()
    names = dict(each.partition("=")[::2] for each in options.topic)
    if unknown := [each for each in names if each not in roles or not names[each]]:
        parser.error(f"--topic {unknown[0]}: expected ROLE=NAME with a role of {', '.join(roles)}")
    for role, name in names.items():
        try:
            re.compile(name)
        except re.error as error:
            parser.error(f"--topic {role}={name}: expected a regular expression; {error}")
    try:
        problems = make(options.bags, options.out, names, options.mcap, options.compare)
    except ReportError as error:
        problems = [str(error)]
    print(*problems, sep="\n", file=sys.stderr, end="\n" if problems else "")
    return 1 if problems else 0


def _new_folder(top, name):
    """Return the folder of a recording's name, emptied."""
    folder = top / re.sub(r"[^\w.-]+", "_", name).strip("._")
    if folder.exists():
        shutil.rmtree(folder)
    return folder


def _why_there_is_no_flight(log):
    yield "It has no flight."
    for event in log.events.events[: report_page.MAX_EVENTS]:
        yield f"{event.time - log.start:.1f} s: {event.kind.value}: {event.text}"


def _write_csv(path, rows):
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([_cell(each) for each in row] for row in rows)


def _cell(value):
    """Return a value, or a text that a spreadsheet does not take for a formula."""
    is_formula = isinstance(value, str) and value.startswith(_FORMULA)
    return f"'{value}" if is_formula else value
