"""Numbers of the last minutes, to be plotted."""

import math
from collections.abc import Callable, Iterable
from functools import lru_cache, partial
from operator import attrgetter
from typing import Any

import numpy as np
import roslib.message

from crazyflie_dashboard.history import SPAN
from crazyflie_dashboard.page_data import Series
from crazyflie_dashboard.snapshot import VehicleSnapshot
from crazyflie_model.angles import rpy_from_quaternion

WINDOW = 60.0  #: Time that a plot shows (s).
_PERIOD = 0.05  #: Period of the numbers that are kept (s).
_SIZE = round(SPAN / _PERIOD)  #: Largest number of them.

#: Types of fields that can be plotted.
_NUMBERS = {"bool", "byte", "char", "time", "duration", "float32", "float64"} | {
    f"{sign}int{size}" for sign in ("", "u") for size in (8, 16, 32, 64)
}

_UNITS = ["m", "m/s", "deg", "m/s^2", "V"]  #: Order of the plots by unit; others come last.

#: Names and units of the first numbers of a state.
_STATE = [(f"position {axis}", "m") for axis in "xyz"]
_STATE += [(f"velocity {axis}", "m/s") for axis in "xyz"]

#: Largest number of series of one vehicle: a log topic may have any number of values.
_MAX_SERIES = 100


class Ring:
    """One plot: the numbers of the last `SPAN`. One thread adds, any reads."""

    def __init__(self, unit: str):
        self.unit = unit
        self._times = np.empty(_SIZE)
        self._values = np.empty(_SIZE, np.float32)
        self._count = 0

    def add(self, time: float, value: float) -> None:
        """Store a number at a time (s), unless the last one is recent enough."""
        last = self._times[(self._count - 1) % _SIZE] if self._count else -math.inf
        if time - last >= 0.9 * _PERIOD:
            self._times[self._count % _SIZE] = time
            self._values[self._count % _SIZE] = value
            self._count += 1

    def series(self, name: str, now: float) -> Series:
        """Return the last `WINDOW` before ``now``."""
        count = self._count
        rows = np.arange(max(0, count - _SIZE), count) % _SIZE
        times = self._times[rows] - now
        begin, end = np.searchsorted(times, (-WINDOW, 1e-9))
        values = self._values[rows[begin:end]].astype(float)
        return Series(name, self.unit, tuple(times[begin:end].tolist()), tuple(values.tolist()))


class VehiclePlots:
    """Plots of one vehicle; ``time()`` is in s."""

    def __init__(self, time: Callable[[], float]):
        self._time = time
        self._rings: dict[str, Ring] = {}
        self._reference: tuple[float, ...] | None = None

    def take(self, role: str, row: Any) -> None:
        """Store a row of a topic, by its role in `bag_topics.ROLES`."""
        if role == "reference":
            self._reference = row
            self._add("reference position z", "m", row[2])
        elif role == "state":
            for (name, unit), value in zip(_STATE, row, strict=False):
                self._add(name, unit, value)
            if self._reference is not None:
                self._add("error", "m", math.dist(row[:3], self._reference[:3]))
        elif role in ("final_control", "cmd_vel"):
            self._add("thrust", "m/s^2", row[3])
        elif role == "battery":
            self._add("battery", "V", row[0])
        elif role.startswith("log "):
            name = role.removeprefix("log ")
            for index, value in enumerate(row):
                self._add(f"{name}[{index}]" if len(row) > 1 else name, "", value)

    def fill(self, past: Iterable[tuple[float, VehicleSnapshot]]) -> None:
        """Store what is known of a vehicle that was not watched: times (s) and snapshots."""
        time = self._time
        for at, now in past:
            self._time = partial(float, at)
            if now.reference is not None:
                self.take("reference", now.reference)
            self.take_pose(now, has_state=False)
            if now.battery is not None:
                self.take("battery", (now.battery,))
        self._time, self._reference = time, None

    def take_pose(self, now: VehicleSnapshot, has_state: bool) -> None:
        """Store a snapshot's attitude; without a topic of states also position and velocity."""
        if now.position is None:
            return
        angles = rpy_from_quaternion(*now.rotation)
        for name, angle in zip(("roll", "pitch", "yaw"), angles, strict=True):
            self._add(name, "deg", math.degrees(angle))
        if not has_state:
            self.take("state", (*now.position, *(now.velocity or ())))

    def series(self, now: float | None = None) -> tuple[Series, ...]:
        """Return all plots until ``now`` (s), the present by default, those of a unit together."""
        now = self._time() if now is None else now
        found = (ring.series(name, now) for name, ring in list(self._rings.items()))
        return tuple(sorted(found, key=lambda each: (*_UNITS, each.unit).index(each.unit)))

    def _add(self, name, unit, value):
        if name not in self._rings:
            if len(self._rings) >= _MAX_SERIES:
                return
            self._rings[name] = Ring(unit)
        self._rings[name].add(self._time(), value)


@lru_cache
def fields_of(kind: str, depth: int = 4) -> tuple[str, ...]:
    """Return the numbers of a type of messages, as in pose/position/x; none of lists."""
    found = roslib.message.get_message_class(kind) if "/" in kind and depth else None
    if found is None:
        return ()
    names: list[str] = []
    for name, each in zip(found.__slots__, found._slot_types, strict=True):
        if each in _NUMBERS:
            names.append(name)
        elif not each.endswith("]"):
            names += [f"{name}/{rest}" for rest in fields_of(each, depth - 1)]
    return tuple(names)


def number_in(message: Any, field: str) -> float:
    """Return the number of a message in one of the `fields_of` its type."""
    value = attrgetter(field.replace("/", "."))(message)
    return float(value.to_sec() if hasattr(value, "to_sec") else value)
