"""Vehicles of a recording as arrays, their flights, and the phases of these."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crazyflie_msgs.msg import FlightStatus
from crazyflie_reports.bag_events import Event, concerning
from crazyflie_reports.bag_log import BagLog, Spool
from crazyflie_reports.bag_topics import ROLES
from crazyflie_reports.flight_record import (
    CONTROL_FIELDS,
    STATE_FIELDS,
    FlightRecord,
    Series,
    gaps,
)
from crazyflie_utils.flight_status import WORDS

Rows = NDArray[np.float64]

_TIME, _STAMP, _NUMBER, _FIRST = 0, 1, 2, 3  # Columns of a spool.
_WIDTHS = {role.name: _FIRST + len(role.fields) for role in ROLES}

#: Difference of stamps from the time of recording above which they are of another clock (s).
OTHER_CLOCK = 10.0

PAUSE = 1.0  #: Time without thrust after which a flight has ended (s).
LIFT = 0.1  #: Height above the lowest pose from which a vehicle with poses only is in flight (m).
MARGIN = 1.0  #: Time before and after a flight that is shown (s).

PHASES = {**WORDS, FlightStatus.UNKNOWN: "unknown"}


@dataclass
class Vehicle:
    """A vehicle in a recording.

    Each array has a time of recording (s) in its first column and the fields that are named here
    in the others; there may be no rows.
    """

    name: str  #: Its namespace, or, without one, its frame on /tf.
    namespace: str
    is_driven: bool  #: Whether a driver has sent its controls: it is not a simulated one.
    #: state, reference: STATE_FIELDS; velocities and yaw may be NaN.
    state: Rows
    stamps: Rows  #: Stamps of the states; 0 for a state without (s).
    reference: Rows
    control: Rows  #: CONTROL_FIELDS.
    command: Rows  #: CONTROL_FIELDS as sent to the driver; no rows without a driver.
    attitude: Rows  #: POSE_FIELDS.
    pose_stamps: Rows  #: Stamps of the poses with an attitude (s); 0 for a pose without a stamp.
    true_pose: Rows  #: POSE_FIELDS, as a virtual vehicle knows it.
    battery: Rows  #: V.
    link: Rows  #: Fraction of answered pings, and number of setpoints that were not sent so far.
    toggles: Rows  #: Without fields.
    flight_states: list[tuple[float, int]]  #: Times (s) and states of its flight, as published.
    delays: Rows  #: Time from the stamp of the newest pose to each control (s).
    #: Number of states that were published and not recorded; None without sequence numbers.
    lost: int | None


def vehicle_namespaces(log: BagLog) -> list[str]:
    """Return the namespaces of the vehicles of a recording, sorted.

    A vehicle is a namespace with states or controls; without any, one with poses.
    """
    flown, driven = _having(log, "state", "final_control"), _having(log, "cmd_vel")
    if flown == {""} and len(driven) == 1:
        driven = set()  # See `_driver`.
    # cf10 comes after cf9.
    return sorted(flown | driven or _having(log, "pose"), key=lambda name: (len(name), name))


def vehicles(log: BagLog) -> Iterator[Vehicle]:
    """Yield the vehicles of a recording, one at a time, by name.

    Without topics of vehicles, frames of /tf that move are vehicles.
    """
    namespaces = vehicle_namespaces(log)
    for namespace in namespaces:
        driver = _driver(log, namespace)
        sources = [each for each in log.sources.values() if each.namespace in (namespace, driver)]
        frame = frame_of(namespace, len(namespaces) == 1, log.frames)
        yield _vehicle(namespace, driver, sources, frame, log)
    if not namespaces:
        for name in sorted(each for each in log.frames if _moves(log.frames[each])):
            yield _vehicle(name, name, [], name, log)


def _having(log, *roles):
    return {each.namespace for each in log.sources.values() if each.role in roles}


def _driver(log, namespace):
    """Return the namespace of a vehicle's driver: in the hardware example only that has one."""
    drivers = _having(log, "cmd_vel", "battery") - _having(log, "state", "final_control")
    return drivers.pop() if not namespace and len(drivers) == 1 else namespace


def frame_of(namespace: str, is_alone: bool, frames: dict[str, Spool]) -> str | None:
    """Return the frame on /tf of a vehicle, which may be the only one; None if it is not known."""
    name = namespace.rpartition("/")[2]
    named = [each for each in frames if name and name in each.split("/")]
    candidates = [each for each in named or (frames if is_alone else ()) if _moves(frames[each])]
    # The vehicle's own frame, not that of its model.
    candidates.sort(key=lambda each: (each.endswith("base_link"), -frames[each].count))
    return candidates[0] if candidates else None


def _moves(spool: Spool) -> bool:
    """Return whether a frame is more than another name of its parent, as base_link is."""
    return bool(spool.rows()[:, _FIRST : _FIRST + 3].any())


def _vehicle(namespace, driver, sources, frame, log):
    def rows(role):
        of_role = [each for each in sources if each.role == role]
        # Among several topics, the one with the most messages.
        longest = max(of_role, key=lambda spool: spool.count, default=None)
        return longest.rows() if longest else np.empty((0, _WIDTHS[role]))

    pose = rows("pose")
    if not len(pose) and frame is not None:
        pose = log.frames[frame].rows()
    state = rows("state")
    lost = _lost(state)
    if not len(state):
        state = _states_of(pose)
    control, cmd_vel = rows("final_control"), rows("cmd_vel")
    is_driven = len(cmd_vel) > 0 or any(each.role == "battery" for each in sources)
    control = control if len(control) else cmd_vel
    return Vehicle(
        name=namespace or frame or "vehicle",
        namespace=namespace,
        is_driven=is_driven,
        state=_without_header(state),
        stamps=state[:, [_TIME, _STAMP]],
        reference=_without_header(rows("reference")),
        control=_without_header(control),
        command=_without_header(cmd_vel),
        attitude=_without_header(pose),
        pose_stamps=pose[:, [_TIME, _STAMP]],
        true_pose=_without_header(rows("true_pose")),
        battery=_without_header(rows("battery")),
        link=np.reshape(log.events.links.get(driver, ()), (-1, 3)),
        flight_states=log.events.flight_states.get(namespace, []),
        toggles=_without_header(rows("toggle")),
        delays=_delays(control, state),
        lost=lost,
    )


def _without_header(rows: Rows) -> Rows:
    return np.delete(rows, [_STAMP, _NUMBER], axis=1)


def _states_of(poses: Rows) -> Rows:
    """Return rows of states from rows of poses, with velocities by central differences.

    A velocity is NaN without a neighbouring pose, as between two gaps. What is infinite is NaN.
    """
    increasing = np.r_[True, np.diff(poses[:, _TIME]) > 1e-4][: len(poses)]
    poses = poses[increasing]
    poses[np.isinf(poses)] = np.nan
    position, yaw = poses[:, _FIRST : _FIRST + 3], poses[:, -1:]
    velocity = np.full_like(position, np.nan)
    ends = np.flatnonzero(gaps(poses[:, _TIME])) + 1
    for begin, end in zip([0, *ends], [*ends, len(poses)], strict=True):
        if end - begin > 1:
            part = slice(begin, end)
            velocity[part] = np.gradient(position[part], poses[part, _TIME], axis=0)
    return np.hstack([poses[:, :_FIRST], position, velocity, yaw])


def _lost(rows: Rows) -> int | None:
    numbers = rows[:, _NUMBER]
    if not numbers.any():
        return None
    steps = np.diff(numbers)
    # A restarted publisher also restarts its sequence numbers.
    return int((steps[steps > 1.0] - 1.0).sum())


def _delays(controls: Rows, states: Rows) -> Rows:
    """Return time of recording and delay of each control.

    None without stamps of this clock. In simulated time messages may be recorded before their time.
    """
    newest = np.searchsorted(states[:, _TIME], controls[:, _TIME], side="right") - 1
    controls = controls[newest >= 0]
    stamps = states[newest[newest >= 0], _STAMP]
    delays = controls[:, _TIME] - stamps
    if not len(delays) or not 0.0 <= np.median(delays) <= OTHER_CLOCK:
        return np.empty((0, 2))
    return np.column_stack([controls[:, _TIME], delays])


@dataclass(frozen=True)
class Phase:
    """A part of a flight: its name, begin and end, s."""

    name: str
    start: float
    end: float


@dataclass
class Flight:
    """A flight of a vehicle."""

    vehicle: Vehicle  #: With all its flights.
    number: int  #: Number of the flight among the vehicle's flights in the recording, from 1.
    phases: list[Phase]
    record: FlightRecord  #: States with `MARGIN` before and after.
    events: list[Event]

    @property
    def start(self) -> float:
        """When the first phase begins, s."""
        return self.phases[0].start

    @property
    def end(self) -> float:
        """When the last phase ends, s."""
        return self.phases[-1].end

    def during(self, rows: Rows, margin: float = 0.0) -> Rows:
        """Return the rows, with times (s) in the first column, in the flight, and around it."""
        return between(rows, self.start - margin, self.end + margin)

    def event_rows(self) -> list[list[Any]]:
        """Return time after the start (s), kind, text and repetitions of each event."""
        return [[round(e.time - self.start, 3), e.kind.value, e.text, e.count] for e in self.events]


def flights(log: BagLog) -> Iterator[Flight]:
    """Yield the flights of a recording; one vehicle's numbers are in memory at a time.

    Phases are those of the states that the takeoff server has published; without them, they follow
    from in_flight, thrust and height.
    """
    names = set(vehicle_namespaces(log))
    for vehicle in vehicles(log):
        own = list(concerning(log.events.events, vehicle.namespace, names))
        states = sorted(vehicle.flight_states)
        known = _phases(states, log.end) if states else _guessed(vehicle)
        lasting = (phases for phases in known if phases[-1].end > phases[0].start)
        for number, phases in enumerate(lasting, 1):
            first, last = phases[0].start - MARGIN, phases[-1].end + MARGIN
            events = [each for each in own if first <= each.time <= last]
            yield Flight(vehicle, number, phases, _record(vehicle, phases, first, last), events)


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
        within = toggles[(toggles > start) & (toggles < end)].tolist()
        if len(within) != 2:
            yield [Phase("flying", start, end)]
            continue
        on, off = within
        yield [Phase("taking off", start, on), Phase("flying", on, off), Phase("landing", off, end)]


def _airborne(vehicle):
    """Return begin and end of each time with thrust or, where no control is known, above ground."""
    if len(vehicle.control):
        times = vehicle.control[vehicle.control[:, 4] > 0.0, 0]
    else:
        states = vehicle.state[np.isfinite(vehicle.state[:, 3])]
        times = states[states[:, 3] > states[:, 3].min(initial=np.inf) + LIFT, 0]
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
    rows = between(rows, first, last)
    # Positions or controls that are not finite, which every node also rejects.
    rows = rows[np.isfinite(rows[:, :4]).all(axis=1)]
    rows[np.isinf(rows)] = np.nan
    return Series(fields, rows)


def between(rows: Rows, first: float, last: float) -> Rows:
    """Return the rows whose times, in the first column, are within two times (s)."""
    begin, end = np.searchsorted(rows[:, 0], first), np.searchsorted(rows[:, 0], last, "right")
    return rows[begin:end]
