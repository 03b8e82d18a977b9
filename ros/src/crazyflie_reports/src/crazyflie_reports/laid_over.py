"""Two recordings of the same time in one report: each flight has the curves of the other one."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crazyflie_reports.bag_report import Report
from crazyflie_reports.report_page import MOST_POINTS, curve

NAMES = ("recorded", "what if")  #: What the recordings of a report are called on the page.
_KEYS = "start", "duration", "path"  # Of a flight that is drawn, and not listed.

Rows = NDArray[np.float64]


def lay_over(report: Report) -> None:
    """Add to each flight of two recordings the curves and paths of the other recording."""
    recordings = report.recordings
    added = [
        (plot, each)
        for recording, other, name in zip(recordings, recordings[::-1], NAMES[::-1], strict=True)
        for flight in recording["flights"]
        for same in other["flights"]
        if _is_same(flight, same)
        for plot, each in _curves(flight, same, name)
    ]
    for plot, each in added:
        plot["curves"].append(each)
    for recording, other, name in zip(recordings, recordings[::-1], NAMES[::-1], strict=True):
        flights = other["flights"]
        recording["others"] = [
            {"vehicle": name, **{key: each[key] for key in _KEYS}} for each in flights
        ]


def _is_same(flight, other):
    end = flight["start"] + flight["duration"], other["start"] + other["duration"]
    is_while = flight["start"] < end[1] and other["start"] < end[0]
    return is_while and flight["vehicle"] == other["vehicle"]


def _curves(flight, other, name):
    """Yield plot and curve for each of the other flight, but for its references."""
    shift = other["start"] - flight["start"]
    plots = {each["title"]: each for each in flight["plots"]}
    for each in other["plots"]:
        for found in each["curves"]:
            if each["title"] in plots and not found["name"].endswith("reference"):
                times = [round(t + shift, 3) for t in found["t"]]
                yield plots[each["title"]], {**found, "name": f"{found['name']} {name}", "t": times}


def add_controls(report: Report, topic: str, rows: tuple[Rows, Rows]) -> None:
    """Add plots of a topic of controls to all flights, before `lay_over`.

    ``rows`` are those of both recordings: time (s) and the fields of a control.
    """
    for recording, values in zip(report.recordings, rows, strict=True):
        for flight in recording["flights"]:
            flight["plots"] += _plots_of_controls(topic, values, flight["start"])


def _plots_of_controls(topic: str, rows: Rows, start: float) -> list[dict[str, Any]]:
    angles = [("roll", 1, math.degrees(1.0)), ("pitch", 2, math.degrees(1.0))]
    groups = (("attitude", "deg", angles), ("thrust", "m/s²", [("thrust", 4, 1.0)]))
    return [
        {
            "title": f"{topic}: {name}",
            "unit": unit,
            "curves": [
                curve(field, rows[:, 0], scale * rows[:, k], start, MOST_POINTS)
                for field, k, scale in fields
            ],
        }
        for name, unit, fields in groups
        if len(rows)
    ]
