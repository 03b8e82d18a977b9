"""Flights of a vehicle in a recording, and their phases."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from crazyflie_msgs.msg import FlightStatus
from crazyflie_reports.bag_events import Event
from crazyflie_reports.bag_vehicles import Rows, Vehicle
from crazyflie_reports.flight_record import CONTROL_FIELDS, STATE_FIELDS, FlightRecord, Series

PAUSE = 1.0  #: Without thrust for longer than this, s, a flight is over.
LIFT = 0.1  #: A vehicle of which only poses are known flies this high above the lowest, m.
MARGIN = 1.0  #: What is shown of the time before and after a flight, s.

PHASES = {
    FlightStatus.UNKNOWN: "unknown",
    FlightStatus.TAKING_OFF: "taking off",
    FlightStatus.FLYING: "flying",
    FlightStatus.DESCENDING: "descending",
    FlightStatus.LANDING: "landing",
}


@dataclass(frozen=True)
class Phase:
    """A part of a flight: its name, begin and end, s."""

    name: str
    start: float
    end: float


@dataclass
class Flight:
    """A flight of a vehicle."""

    vehicle: str  #: Its name.
    number: int  #: Of the vehicle's flights in the recording, from 1.
    phases: list[Phase]
    record: FlightRecord  #: With `MARGIN` before and after.
    #: attitude, battery, link, delays: As in `Vehicle`.
    attitude: Rows
    battery: Rows
    link: Rows
    delays: Rows
    lost: int | None  #: As in `Vehicle`.
    is_driven: bool  #: As in `Vehicle`.
    events: list[Event]

    @property
    def start(self) -> float:
        """When the first phase begins, s."""
        return self.phases[0].start

    @property
    def end(self) -> float:
        """When the last phase ends, s."""
        return self.phases[-1].end


def flights(
    vehicle: Vehicle, states: list[tuple[float, int]], events: list[Event], end: float
) -> Iterator[Flight]:
    """Yield the flights of a vehicle, from the events that concern it.

    ``states`` are times (s) and states of its flight, as the takeoff server has published them;
    where there are none, the phases follow from in_flight, thrust and height. ``end`` is that of
    the recording, s.
    """
    known = _phases(sorted(states), end) if states else _guessed(vehicle)
    lasting = (phases for phases in known if phases[-1].end > phases[0].start)
    for number, phases in enumerate(lasting, 1):
        first, last = phases[0].start - MARGIN, phases[-1].end + MARGIN
        yield Flight(
            vehicle.name,
            number,
            phases,
            _record(vehicle, phases, first, last),
            _between(vehicle.attitude, first, last),
            _between(vehicle.battery, first, last),
            _between(vehicle.link, first, last),
            _between(vehicle.delays, phases[0].start, phases[-1].end),
            vehicle.lost,
            vehicle.is_driven,
            [each for each in events if first <= each.time <= last],
        )


def _phases(states, end):
    """Yield a list of phases for each flight."""
    phases: list[Phase] = []
    for (start, state), (stop, _) in zip(states, [*states[1:], (end, 0)], strict=True):
        if state != FlightStatus.ON_GROUND:
            phases.append(Phase(PHASES.get(state, "unknown"), start, max(start, stop)))
        elif phases:
            yield phases
            phases = []
    if phases:
        yield phases


def _guessed(vehicle):
    toggles = vehicle.toggles[:, 0]
    for start, end in _airborne(vehicle):
        moments = [start, *toggles[(toggles > start) & (toggles < end)], end]
        names = ["taking off", "flying", "landing"] if len(moments) == 4 else ["flying"]
        if len(names) == 1:
            moments = [start, end]
        yield [Phase(*each) for each in zip(names, moments, moments[1:], strict=False)]


def _airborne(vehicle):
    """Return begin and end of each time with thrust or, where no control is known, above ground."""
    if len(vehicle.control):
        times, flies = vehicle.control[:, 0], vehicle.control[:, 4] > 0.0
    elif len(vehicle.state):
        height = vehicle.state[:, 3]
        times, flies = vehicle.state[:, 0], height > np.nanmin(height) + LIFT
    else:
        return []
    times = times[flies]
    if not len(times):
        return []
    pauses = np.flatnonzero(np.diff(times) > PAUSE)
    starts, ends = np.r_[times[0], times[pauses + 1]], np.r_[times[pauses], times[-1]]
    return [(float(a), float(b)) for a, b in zip(starts, ends, strict=True) if b > a]


def _record(vehicle, phases, first, last):
    events = {"takeoff": phases[0].start, "landed": phases[-1].end}
    by_name = {each.name: each.start for each in reversed(phases)}
    events["flying"] = by_name.get("flying", events["takeoff"])
    down = [each.start for each in phases if each.name in ("descending", "landing")]
    events["land"] = min(down, default=events["landed"])
    return FlightRecord(
        state=_series(vehicle.state, STATE_FIELDS, first, last),
        final_control=_series(vehicle.control, CONTROL_FIELDS, first, last),
        reference=_series(vehicle.reference, STATE_FIELDS, first, last),
        events=events,
    )


def _series(rows, fields, first, last):
    rows = _between(rows, first, last)
    # Positions, or controls, that are no numbers, which every node rejects, too.
    rows = rows[np.isfinite(rows[:, :4]).all(axis=1)]
    rows[np.isinf(rows)] = np.nan
    return Series.of(fields, rows[:, 0], rows[:, 1:])


def _between(rows, first, last):
    begin, end = np.searchsorted(rows[:, 0], first), np.searchsorted(rows[:, 0], last, "right")
    return rows[begin:end]
