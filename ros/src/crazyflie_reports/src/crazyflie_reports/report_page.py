"""The page of a report: one HTML file, with the flights' numbers and its own script in it."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import rospkg
from numpy.typing import NDArray

from crazyflie_reports.bag_flights import MARGIN, Flight
from crazyflie_reports.figures import Figure
from crazyflie_reports.flight_record import gaps

Array = NDArray[np.float64]

#: Largest and smallest number of points of a curve, and approximate number for all flights.
MOST_POINTS, LEAST_POINTS, ALL_POINTS = 1000, 100, 40_000
FRAME_PERIOD = 0.04  #: Period of the replay's poses, if the number of points allows it (s).
MAX_EVENTS = 300  #: Largest number of entries in a flight's list.


def points_of(vehicles: int) -> int:
    """Return the number of points of a curve in a report on a number of vehicles."""
    return int(np.clip(ALL_POINTS // max(1, vehicles), LEAST_POINTS, MOST_POINTS))


def decimated(times: Array, values: Array, points: int) -> tuple[Array, Array]:
    """Return times and values, shape (n,), reduced to about ``points``.

    The smallest and the largest value of each interval are kept, which keeps peaks, and one NaN,
    which keeps gaps.
    """
    if len(values) <= points:
        return times, values
    kept: list[int] = []
    parts = points // (3 if np.isnan(values).any() else 2)
    for part in np.array_split(np.arange(len(values)), parts):
        is_known = np.isfinite(values[part])
        known = part[is_known]
        extremes = (values[known].argmin(), values[known].argmax()) if len(known) else ()
        kept += sorted({*known[list(extremes)], *part[~is_known][:1]})
    return times[kept], values[kept]


def flight_data(flight: Flight, found: list[Figure], points: int) -> dict[str, Any]:
    """Return the page's data of a flight with its figures; times are from its start, s."""
    events = flight.event_rows()
    return {
        "vehicle": flight.vehicle.name,
        "number": flight.number,
        "start": round(flight.start, 3),
        "duration": round(flight.end - flight.start, 3),
        "phases": [[p.name, *_rounded([p.start, p.end], flight.start)] for p in flight.phases],
        "events": events[:MAX_EVENTS],
        "more_events": max(0, len(events) - MAX_EVENTS),
        "figures": [
            [float(f"{f.value:.4g}") if math.isfinite(f.value) else None, f.is_normal, f.normal]
            for f in found
        ],
        "plots": _plots(flight, points),
        "path": _path(flight, points),
    }


def page(recordings: list[dict[str, Any]], names: list[list[str]]) -> str:
    """Return the HTML of a report.

    A recording has name, start, duration, remarks, and flights as `flight_data` returns them; a
    figure in ``names`` has a name, a unit, what it needs to be known, and a note.
    """
    folder = Path(rospkg.RosPack().get_path("crazyflie_reports")) / "page"
    data = json.dumps({"recordings": recordings, "figures": names}, allow_nan=False)
    scripts = "".join((folder / f"{name}.js").read_text() for name in ("plots", "replay", "report"))
    # The first line of the script is its address, which the page replaces by its license.
    library = (folder / "uplot" / "uPlot.iife.min.js").read_text().partition("\n")[2]
    parts = {
        "style": (folder / "uplot" / "uPlot.min.css").read_text(),
        "library": f"/* uPlot\n{(folder / 'uplot' / 'LICENSE').read_text()}*/\n{library}",
        "scripts": scripts,
        # Within a script element only "<" could end the element.
        "data": data.replace("<", "\\u003c"),
    }
    html = (folder / "report.html").read_text()
    for name, text in parts.items():
        html = html.replace(f"{{{{{name}}}}}", text)
    return html


def _plots(flight, points):
    record, start = flight.record, flight.start
    state, reference, control = record.state, record.reference, record.final_control

    def curves(series, names, scale=1.0, suffix=""):
        return [
            curve(name + suffix, series.times, scale * series.column(name), start, points)
            for name in names
        ]

    def angles(name, times, values):
        known = np.isfinite(values)
        turns = np.degrees(np.unwrap(values[known]))
        return curve(name, times[known], turns, start, points)

    xyz = ("x", "y", "z")
    measured = flight.during(flight.vehicle.attitude, MARGIN)
    attitude = [
        angles(name, measured[:, 0], measured[:, column])
        for name, column in (("roll", 4), ("pitch", 5), ("yaw", 6))
    ]
    if not len(measured):
        attitude = [angles("yaw", state.times, state.column("yaw"))]
    attitude += curves(control, ["roll", "pitch"], math.degrees(1.0), " commanded")
    attitude.append(angles("yaw reference", reference.times, reference.column("yaw")))
    times, distances = record.tracking_errors()
    error = curve("distance", times, distances, start, points)
    volts = flight.during(flight.vehicle.battery, MARGIN)
    battery = curve("voltage", volts[:, 0], volts[:, 1], start, points)
    plots = [
        ("position", "m", curves(state, xyz) + curves(reference, xyz, 1.0, " reference")),
        ("distance from the reference", "m", [error]),
        ("velocity", "m/s", curves(state, ("x_dot", "y_dot", "z_dot"))),
        ("attitude", "deg", attitude),
        ("thrust", "m/s²", curves(control, ["thrust"])),
        ("battery", "V", [battery]),
    ]
    return [
        {"title": title, "unit": unit, "curves": [c for c in those if c["t"]]}
        for title, unit, those in plots
        if any(c["t"] for c in those)
    ]


def curve(name: str, times: Array, values: Array, start: float, points: int) -> dict[str, Any]:
    """Return a curve of a plot, with times from ``start`` (s) on, reduced to about ``points``."""
    known = np.isfinite(values)
    times, values = times[known], values[known]
    # A reference is valid until the next one.
    if not name.endswith("reference"):
        times, values = _broken(times, values)
    times, values = decimated(times, values, points)
    # Rounded, numbers above 1e304 are infinite.
    numbers = [v if math.isfinite(v) else None for v in np.round(values, 4).tolist()]
    return {"name": name, "t": _rounded(times, start), "v": numbers}


def _broken(times, values):
    """Return times and values with a NaN in each gap, where nothing is known."""
    ends = np.flatnonzero(gaps(times)) + 1
    between = (times[ends - 1] + times[ends]) / 2.0
    return np.insert(times, ends, between), np.insert(values, ends, math.nan, axis=0)


def _path(flight, points):
    """Return poses at equal intervals: position, roll, pitch, yaw (m, rad), and the reference.

    A pose in a gap is None, and so is one that is too large to be written.
    """
    state, reference = flight.record.state, flight.record.reference.rows
    if not len(state):
        return None
    times, values = _broken(state.times, state.values)
    period = max(FRAME_PERIOD, (times[-1] - times[0]) / points)
    moments = times[0] + period * np.arange((times[-1] - times[0]) // period + 1)
    attitude = flight.during(flight.vehicle.attitude, MARGIN)
    if not len(attitude):
        attitude = np.zeros((len(state), 7))
        attitude[:, [0, 6]] = np.column_stack([state.times, state.column("yaw")])
    turns = _broken(attitude[:, 0], np.unwrap(np.nan_to_num(attitude[:, 4:7]), axis=0))
    columns = [np.interp(moments, times, values[:, k]) for k in range(3)]
    columns += [np.interp(moments, turns[0], turns[1][:, k]) for k in range(3)]
    poses = np.round(np.column_stack(columns), 3)
    if len(reference):
        newest = np.searchsorted(reference[:, 0], moments, side="right") - 1
        places = np.nan_to_num(reference[np.maximum(newest, 0), 1:4], posinf=0.0, neginf=0.0)
        poses = np.hstack([poses, np.round(places, 3)])
    return {
        "start": round(float(times[0] - flight.start), 3),
        "period": period,
        "rows": [row if math.isfinite(sum(row)) else None for row in poses.tolist()],
    }


def _rounded(times, start):
    return np.round(np.asarray(times) - start, 3).tolist()
