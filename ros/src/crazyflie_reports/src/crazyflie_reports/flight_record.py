"""Recorded topics and events of a flight as arrays, and figures of merit."""

import csv
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

STATE_FIELDS = ("x", "y", "z", "x_dot", "y_dot", "z_dot", "yaw")
CONTROL_FIELDS = ("roll", "pitch", "yaw_dot", "thrust")

GROUND_TOLERANCE = 0.01  #: A vehicle below this height stands on the ground, m.
AT_POINT = 0.001  #: References closer to a point than this lead to it, m.


class Series:
    """Rows of numbers with the times they belong to, growing.

    One thread may append while another reads. ``fields`` are the names of the columns.
    """

    def __init__(self, fields: tuple[str, ...]):
        self.fields = fields
        self._times: list[float] = []
        self._rows: list[ArrayLike] = []

    @classmethod
    def of(cls, fields: tuple[str, ...], times: ArrayLike, values: ArrayLike) -> "Series":
        """Return a series of times (s), shape (n,), and rows, shape (n, len(fields))."""
        series = cls(fields)
        series._times, series._rows = np.asarray(times), np.asarray(values)  # type: ignore[assignment]
        return series

    def append(self, time: float, row: ArrayLike) -> None:
        """Add a row, shape (len(fields),), at ``time`` (s)."""
        # In this order, so that each time has its row.
        self._rows.append(row)
        self._times.append(time)

    def __len__(self) -> int:
        return len(self._times)

    @property
    def times(self) -> NDArray[np.float64]:
        """Times, s, shape (n,)."""
        return np.asarray(self._times, dtype=float)

    @property
    def values(self) -> NDArray[np.float64]:
        """Rows, shape (n, len(fields)); more than `times` if some came since that was taken."""
        return np.asarray(self._rows, dtype=float).reshape(-1, len(self.fields))

    def column(self, name: str) -> NDArray[np.float64]:
        """Return one column, shape (n,)."""
        return self.values[:, self.fields.index(name)]

    def between(self, start: float, end: float) -> NDArray[np.float64]:
        """Return the rows with start <= time <= end (s), shape (m, len(fields))."""
        times = self.times
        return self.values[: len(times)][(times >= start) & (times <= end)]

    @property
    def last_time(self) -> float:
        """Time of the newest row, s."""
        return self._times[-1]

    @property
    def last(self) -> NDArray[np.float64]:
        """The newest row."""
        return np.asarray(self._rows[-1], dtype=float)


@dataclass
class FlightRecord:
    """Messages and events of one flight; times in s of ROS time."""

    #: state, final_control, takeoff_control, reference: What was published on these topics.
    state: Series = field(default_factory=lambda: Series(STATE_FIELDS))
    final_control: Series = field(default_factory=lambda: Series(CONTROL_FIELDS))
    takeoff_control: Series = field(default_factory=lambda: Series(CONTROL_FIELDS))
    reference: Series = field(default_factory=lambda: Series(STATE_FIELDS[:6]))
    toggles: list[float] = field(default_factory=list)  #: When in_flight was toggled.
    #: When something was done: "takeoff" and "land" (called), "flying" and "landed" (answered).
    events: dict[str, float] = field(default_factory=dict)

    def position_error(self, point: ArrayLike) -> NDArray[np.float64]:
        """Return the distance of every recorded state from a point (m), shape (n,)."""
        return np.linalg.norm(self.state.values[:, :3] - np.asarray(point), axis=1)

    def hover_interval(self, point: ArrayLike) -> tuple[float, float]:
        """Return from when and until when references led to a point (m), s.

        From the end of the takeoff until /land was called at the latest.
        """
        begin, end = self.events.get("flying", self.events["takeoff"]), self.events["land"]
        times = self.reference.times
        distances = np.linalg.norm(self.reference.values[:, :3] - np.asarray(point), axis=1)
        arrived = (times >= self.events["takeoff"]) & (distances < AT_POINT)
        if arrived.any():
            begin = max(begin, float(times[arrived][0]))
            left = times[(times > begin) & (distances > AT_POINT)]
            end = float(min([*left[:1], end]))
        return begin, end

    def tracking_errors(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return times (s) and distances (m) of states from the references of then, shape (n,).

        Of the states for which a reference has come before.
        """
        times = self.state.times
        newest = np.searchsorted(self.reference.times, times, side="right") - 1
        known = newest >= 0
        references = self.reference.values[newest[known], :3]
        states = self.state.values[known, :3]
        return times[known], np.linalg.norm(states - references, axis=1)

    def time_to_hover(self, point: ArrayLike, tolerance: float) -> float:
        """Return how long after the call of /takeoff the vehicle was at a point to stay, s.

        From then on until the end of `hover_interval` it is within ``tolerance`` of the point, m;
        NaN when it never stayed.
        """
        times, errors = self._hover(point)
        outside = np.flatnonzero(errors > tolerance)
        first = outside[-1] + 1 if outside.size else 0
        if first >= times.size:
            return float("nan")
        return float(times[first] - self.events["takeoff"])

    def overshoot(self, point: ArrayLike) -> float:
        """Return how far the vehicle rose above a hover point (m) until it left it, at least 0."""
        times, height = self.state.times, np.asarray(point)[2]
        until = self.state.column("z")[times <= self.hover_interval(point)[1]]
        return max(0.0, float(until.max(initial=height)) - float(height))

    def hover_error(self, point: ArrayLike, duration: float) -> tuple[float, float]:
        """Return mean and maximum distance (m) from a point in the last ``duration`` s of a hover.

        ValueError: no state was recorded in that time.
        """
        times, errors = self._hover(point)
        errors = errors[times >= self.hover_interval(point)[1] - duration]
        if not errors.size:
            raise ValueError("no state was recorded during the hover")
        return float(errors.mean()), float(errors.max())

    def touchdown_speed(self) -> float:
        """Return the downward speed at which the vehicle met the ground (m/s).

        The fastest of the last tenth of a second above `GROUND_TOLERANCE`. ValueError: it did not
        come down.
        """
        times, heights = self.state.times, self.state.column("z")
        descending = np.flatnonzero((times >= self.events["land"]) & (heights > GROUND_TOLERANCE))
        if not descending.size or descending[-1] == len(times) - 1:
            raise ValueError("the vehicle did not reach the ground")
        contact = times[descending[-1] + 1]
        window = (times >= contact - 0.1) & (times <= contact)
        return float(max(0.0, -self.state.column("z_dot")[window].min()))

    def save_csv(self, path: Path) -> None:
        """Write state and control, one row for every state, times from the call of /takeoff."""
        control_times = self.final_control.times
        controls = self.final_control.values
        with path.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["time", *STATE_FIELDS, *CONTROL_FIELDS])
            for time, state in zip(self.state.times, self.state.values, strict=True):
                index = int(np.searchsorted(control_times, time, side="right")) - 1
                control = controls[index] if index >= 0 else [np.nan] * len(CONTROL_FIELDS)
                writer.writerow([f"{time - self.events['takeoff']:.3f}", *state, *control])

    def _hover(self, point):
        times = self.state.times
        hover = (times >= self.events["takeoff"]) & (times <= self.hover_interval(point)[1])
        return times[hover], self.position_error(point)[hover]
