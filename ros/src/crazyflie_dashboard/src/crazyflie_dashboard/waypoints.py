"""Waypoints that are set on the page, and the mission through them."""

import re
from collections.abc import Callable
from pathlib import Path

from crazyflie_dashboard.snapshot import Triple
from crazyflie_utils.refusal import RefusalError

Points = tuple[Triple, ...]

_NAME = re.compile(r"[A-Za-z][\w-]*")
_SCRIPT = '''\
#!/usr/bin/env python
"""The centre of the vehicles flies through waypoints; they keep their formation.

Usage: {name}.py [NAME ...], the vehicles; by default cf1.
"""

import sys

from crazyflie_mission_api import Fleet

WAYPOINTS = {points}  # m


def mission(fleet):
    fleet.takeoff(WAYPOINTS[0][2])
    places = {{name: fleet.position(name) for name in fleet.names}}
    for point in WAYPOINTS:
        shift = [p - sum(place) / len(places) for p, place in zip(point, zip(*places.values()))]
        fleet.go_to({{name: tuple(map(sum, zip(p, shift))) for name, p in places.items()}})
    fleet.land()


if __name__ == "__main__":
    with Fleet(sys.argv[1:] or ["cf1"]) as group:
        group.fly(mission)
'''


class Waypoints:
    """Waypoints of one page, m, whose changes can be undone."""

    def __init__(self) -> None:
        self.points: Points = ()
        self._before: list[Points] = []
        #: Called when they have changed.
        self.on_change: Callable[[], None] = lambda: None

    def insert(self, number: int, point: Triple) -> None:
        """Put a point before that of a number, from 0; at the end by their count."""
        self._set((*self.points[:number], point, *self.points[number:]))

    def move(self, number: int, point: Triple) -> None:
        """Move a point."""
        self._set((*self.points[:number], point, *self.points[number + 1 :]))

    def clear(self) -> None:
        """Remove all of them."""
        self._set(())

    @property
    def can_undo(self) -> bool:
        """Whether there is a change to take back."""
        return bool(self._before)

    def undo(self) -> None:
        """Take back the last change."""
        if self._before:
            self.points = self._before.pop()
            self.on_change()

    def _set(self, points):
        self._before.append(self.points)
        self.points = points
        self.on_change()


def save(folder: Path, name: str, points: Points) -> Path:
    """Write the mission through points (m); return its file.

    `RefusalError`: there is no point, or the name is not that of a file.
    """
    if not points:
        raise RefusalError("save: no waypoint is set; click on the floor to set one")
    if not _NAME.fullmatch(name):
        raise RefusalError(f"save: the name is {name!r}; expected letters, digits, - and _")
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{name}.py"
    rows = "".join(f"    ({x:.3f}, {y:.3f}, {z:.3f}),\n" for x, y, z in points)
    file.write_text(_SCRIPT.format(name=name, points=f"[\n{rows}]"))
    return file
