"""Recorded topics and events of a flight as arrays, figures of merit, and their limits."""

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

STATE_FIELDS = ("x", "y", "z", "x_dot", "y_dot", "z_dot", "yaw")
CONTROL_FIELDS = ("roll", "pitch", "yaw_dot", "thrust")

GROUND_TOLERANCE = 0.01  #: Height below which a vehicle is on the ground (m).
GAP_LIMIT = 0.1  #: Time without a new state after which a vehicle is not controlled (s).
_LONG = 3.0  # Number of periods of a pause that is a gap in a slower series.
AT_POINT = 0.001  #: Distance of references from a point below which they lead to it (m).

HOVER_TOLERANCE = 0.01  #: Largest distance from the hover point of a good flight, m.
HOVER_WINDOW = 5.0  #: Time before the end of the hover in which its error is measured (s).
OVERSHOOT_LIMIT = 0.1  #: Largest overshoot of a good flight (m).
TOUCHDOWN_LIMIT = 0.5  #: Fastest touchdown of a good flight, m/s.


def gaps(times: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which steps of times (s), shape (n,), are gaps; shape (n - 1,), or (0,) without times.

    The motion in a gap is not known. A gap is longer than `GAP_LIMIT` and than three usual steps.
    """
    steps = np.diff(times)
    return steps > max(GAP_LIMIT, _LONG * float(np.median(steps)) if len(steps) else 0.0)


class Series:
    """Rows of numbers with the times they belong to, growing.

    One thread may append while another reads. ``fields`` are the names of the columns, ``rows``
    times (s) and rows, shape (n, 1 + len(fields)), to which none is appended.
    """

    def __init__(self, fields: tuple[str, ...], rows: NDArray[np.float64] | None = None):
        self.fields = fields
        self._rows: Any = [] if rows is None else rows

    def append(self, time: float, row: Iterable[float]) -> None:
        """Add a row, shape (len(fields),), at ``time`` (s)."""
        self._rows.append((time, *row))

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def rows(self) -> NDArray[np.float64]:
        """Times (s) and rows until now, shape (n, 1 + len(fields))."""
        return np.asarray(self._rows[:], dtype=float).reshape(-1, 1 + len(self.fields))

    @property
    def times(self) -> NDArray[np.float64]:
        """Times, s, shape (n,)."""
        return self.rows[:, 0]

    @property
    def values(self) -> NDArray[np.float64]:
        """Rows, shape (n, len(fields)); more than `times` if some came since that was taken."""
        return self.rows[:, 1:]

    def column(self, name: str) -> NDArray[np.float64]:
        """Return one column, shape (n,)."""
        return self.values[:, self.fields.index(name)]

    def between(self, start: float, end: float) -> NDArray[np.float64]:
        """Return the rows with start <= time <= end (s), shape (m, len(fields))."""
        rows = self.rows
        return rows[(rows[:, 0] >= start) & (rows[:, 0] <= end), 1:]

    @property
    def last_time(self) -> float:
        """Time of the newest row, s."""
        return self._rows[-1][0]

    @property
    def last(self) -> NDArray[np.float64]:
        """The newest row."""
        return np.asarray(self._rows[-1][1:], dtype=float)


@dataclass
class FlightRecord:
    """Messages and events of one flight; times in s of ROS time."""

    #: state, final_control, takeoff_control, reference: Messages of these topics.
    state: Series = field(default_factory=lambda: Series(STATE_FIELDS))
    final_control: Series = field(default_factory=lambda: Series(CONTROL_FIELDS))
    takeoff_control: Series = field(default_factory=lambda: Series(CONTROL_FIELDS))
    reference: Series = field(default_factory=lambda: Series(STATE_FIELDS[:6]))
    #: Times at which in_flight was toggled. Times of events: "takeoff" and "land" (called),
    #: "flying" and "landed" (answered).
    toggles: list[float] = field(default_factory=list)
    events: dict[str, float] = field(default_factory=dict)

    def hover_interval(self, point: ArrayLike) -> tuple[float, float]:
        """Return begin and end of the time in which references led to a point (m), s.

        From the end of the takeoff until /land was called at the latest.
        """
        begin, end = self.events.get("flying", self.events["takeoff"]), self.events["land"]
        times, distances = _distances(self.reference, point)
        arrived = times[(times >= self.events["takeoff"]) & (distances < AT_POINT)]
        if len(arrived):
            begin = max(begin, float(arrived[0]))
            end = float(min([*times[(times > begin) & (distances > AT_POINT)][:1], end]))
        return begin, end

    def tracking_errors(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return times (s) and distances (m) of states from their references, shape (n,).

        States before the first reference are not included.
        """
        states, references = self.state.rows, self.reference.rows
        newest = np.searchsorted(references[:, 0], states[:, 0], side="right") - 1
        states, references = states[newest >= 0], references[newest[newest >= 0]]
        return states[:, 0], np.linalg.norm(states[:, 1:4] - references[:, 1:4], axis=1)

    def time_to_hover(self, point: ArrayLike, tolerance: float) -> float:
        """Return the time from the call of /takeoff until the vehicle stays at a point, s.

        From then on until the end of `hover_interval` it is within ``tolerance`` of the point, m;
        NaN when it never stayed.
        """
        times, errors = self._hover(point)
        outside = np.flatnonzero(errors > tolerance)
        inside = times[outside[-1] + 1 :] if outside.size else times
        return float(inside[0] - self.events["takeoff"]) if inside.size else float("nan")

    def overshoot(self, point: ArrayLike) -> float:
        """Return the overshoot above a hover point (m), at least 0; NaN without a known height."""
        height, states = float(np.asarray(point)[2]), self._states()
        heights = states[states[:, 0] <= self.hover_interval(point)[1], 3]
        return max(0.0, float(heights.max()) - height) if len(heights) else float("nan")

    def hover_error(self, point: ArrayLike, duration: float) -> tuple[float, float]:
        """Return mean and maximum distance (m) from a point in the last ``duration`` s of a hover.

        ValueError: no state is known in that time.
        """
        _, errors = self._hover(point, duration)
        if not errors.size:
            raise ValueError("no state was recorded during the hover")
        return float(errors.mean()), float(errors.max())

    def touchdown_speed(self) -> float:
        """Return the downward speed at which the vehicle met the ground (m/s).

        The fastest of the last tenth of a second above `GROUND_TOLERANCE`; NaN when the vehicle did
        not come down, or no velocity is known there.
        """
        rows = self._states()
        times, heights, speeds = rows[:, 0], rows[:, 3], -rows[:, 6]
        descending = np.flatnonzero((times >= self.events["land"]) & (heights > GROUND_TOLERANCE))
        if not descending.size or descending[-1] == len(times) - 1:
            return float("nan")
        contact = times[descending[-1] + 1]
        speeds = speeds[(times >= contact - 0.1) & (times <= contact) & np.isfinite(speeds)]
        return float(max(0.0, speeds.max())) if speeds.size else float("nan")

    def save_csv(self, path: Path) -> None:
        """Write state and control, one row for every state, times from the call of /takeoff."""
        controls = self.final_control.rows
        with path.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["time", *STATE_FIELDS, *CONTROL_FIELDS])
            for time, *state in self.state.rows:
                before = controls[: np.searchsorted(controls[:, 0], time, side="right"), 1:]
                control = before[-1] if len(before) else [np.nan] * len(CONTROL_FIELDS)
                writer.writerow([f"{time - self.events['takeoff']:.3f}", *state, *control])

    def _states(self):
        """Return times (s) and states of known height, shape (n, 1 + len(STATE_FIELDS))."""
        rows = self.state.rows
        return rows[~np.isnan(rows[:, 3])]

    def _hover(self, point, duration=np.inf):
        """Return times and distances from the point, of the last ``duration`` s until its end."""
        end, (times, errors) = self.hover_interval(point)[1], _distances(self.state, point)
        hover = (times >= max(self.events["takeoff"], end - duration)) & (times <= end)
        return times[hover], errors[hover]


def _distances(series, point):
    """Return times and distances from a point, where they are known."""
    rows = series.rows
    distances = np.linalg.norm(rows[:, 1:4] - np.asarray(point), axis=1)
    is_known = ~np.isnan(distances)
    return rows[is_known, 0], distances[is_known]


@dataclass(frozen=True)
class FlightReport:
    """Figures of one flight from /takeoff to /land; NaN if it has no hover or no touchdown."""

    time_to_hover: float  #: Time from /takeoff until it stayed within `HOVER_TOLERANCE` (s).
    overshoot: float  #: Overshoot above the hover height, m.
    #: hover_error_mean, hover_error_max: Distance from the hover point at the end of the hover, m.
    hover_error_mean: float
    hover_error_max: float
    touchdown_speed: float  #: m/s.
    final_height: float  #: m.
    final_thrust: float  #: m/s^2.

    @classmethod
    def of(
        cls, record: FlightRecord, point: Sequence[float], window: float = HOVER_WINDOW
    ) -> "FlightReport":
        """Return the report of a record with the hover point x, y, z, m.

        The hover error is that of the last ``window`` s of the hover.
        """
        mean, largest = record.hover_error(point, window)
        return cls(
            time_to_hover=record.time_to_hover(point, HOVER_TOLERANCE),
            overshoot=record.overshoot(point),
            hover_error_mean=mean,
            hover_error_max=largest,
            touchdown_speed=record.touchdown_speed(),
            final_height=float(record._states()[-1, 3]),
            final_thrust=float(record.final_control.last[3]),
        )

    def complaints(self) -> list[str]:
        """Return the faults of the flight, a sentence each; empty for a good one."""
        checks = [
            (
                self.hover_error_max <= HOVER_TOLERANCE,
                f"it strayed {self.hover_error_max * 1000:.1f} mm from the hover point "
                f"(limit {HOVER_TOLERANCE * 1000:.0f} mm)",
            ),
            (
                not self.overshoot > OVERSHOOT_LIMIT,
                f"it rose {self.overshoot * 1000:.0f} mm above the hover point "
                f"(limit {OVERSHOOT_LIMIT * 1000:.0f} mm)",
            ),
            (
                not self.touchdown_speed > TOUCHDOWN_LIMIT,
                f"it touched down at {self.touchdown_speed:.2f} m/s "
                f"(limit {TOUCHDOWN_LIMIT:g} m/s)",
            ),
            (
                self.final_height <= GROUND_TOLERANCE,
                f"it is {self.final_height:.3f} m above the ground after landing",
            ),
            (self.final_thrust == 0.0, f"thrust is {self.final_thrust:.2f} m/s^2 after landing"),
        ]
        return [complaint for is_good, complaint in checks if not is_good]

    def table(self) -> str:
        """Return the figures as lines of text."""
        rows = [
            ("time to hover", f"{self.time_to_hover:.2f} s"),
            ("overshoot", f"{self.overshoot * 1000:.1f} mm"),
            ("hover error, mean", f"{self.hover_error_mean * 1000:.2f} mm"),
            ("hover error, maximum", f"{self.hover_error_max * 1000:.2f} mm"),
            ("touchdown speed", f"{self.touchdown_speed:.2f} m/s"),
        ]
        known = ((name, "-" if value.startswith("nan") else value) for name, value in rows)
        return "\n".join(f"{name:<22}{value:>12}" for name, value in known)
