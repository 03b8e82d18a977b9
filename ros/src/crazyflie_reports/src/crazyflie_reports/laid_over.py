"""Two recordings in one report: each flight has the curves of the other one."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crazyflie_reports.report_page import MOST_POINTS, curve

#: What recordings of the same time, and those that are compared, are called on the page.
NAMES, COMPARED = ("recorded", "what if"), ("first", "second")

Rows = NDArray[np.float64]
Recordings = list[dict[str, Any]]


def lay_over(recordings: Recordings, is_same_time: bool = True) -> None:
    """Add to each flight of two recordings the curves and the path of the other recording's flight.

    That is the vehicle's flight at the same time, or the one of the same number: times count from
    each takeoff then.
    """
    names = NAMES if is_same_time else COMPARED
    pairs = [
        (flight, same, same["start"] - flight["start"] if is_same_time else 0.0, name)
        for recording, other, name in zip(recordings, recordings[::-1], names[::-1], strict=True)
        for flight in recording["flights"]
        for same in other["flights"]
        if flight["vehicle"] == same["vehicle"]
        and (_overlap(flight, same) if is_same_time else flight["number"] == same["number"])
    ]
    added = [each for pair in pairs for each in _curves(*pair)]
    for plot, each in added:
        plot["curves"].append(each)
    for flight, same, shift, name in pairs:
        other = {"vehicle": name, "start": flight["start"] + shift}
        others = flight.setdefault("others", [])
        others.append({**other, **{key: same[key] for key in ("duration", "path")}})


def _overlap(flight, other):
    end = flight["start"] + flight["duration"], other["start"] + other["duration"]
    return flight["start"] < end[1] and other["start"] < end[0]


def _curves(flight, other, shift, name):
    """Yield plot and curve for each of the other flight, but for its references."""
    plots = {each["title"]: each for each in flight["plots"]}
    for each in other["plots"]:
        for found in each["curves"]:
            if each["title"] in plots and not found["name"].endswith("reference"):
                times = [round(t + shift, 3) for t in found["t"]]
                yield plots[each["title"]], {**found, "name": f"{found['name']} {name}", "t": times}


def add_controls(recordings: Recordings, topic: str, rows: tuple[Rows, Rows]) -> None:
    """Add plots of a topic of controls to all flights, before `lay_over`.

    ``rows`` are those of both recordings: time (s) and the fields of a control.
    """
    for recording, values in zip(recordings, rows, strict=True):
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
