"""Vehicles of a recording: which topics belong to which, as arrays."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crazyflie_reports.bag_log import BagLog, Spool
from crazyflie_reports.bag_topics import POSE_FIELDS
from crazyflie_reports.flight_record import CONTROL_FIELDS, STATE_FIELDS

Rows = NDArray[np.float64]

_TIME, _STAMP, _NUMBER, _FIRST = 0, 1, 2, 3  # Columns of a spool.

OTHER_CLOCK = 10.0  #: Stamps that are further from the time of recording, s, are another clock's.


@dataclass
class Vehicle:
    """What was recorded of a vehicle.

    Each array has a time of recording (s) in its first column and the fields that are named here
    in the others; there may be no rows.
    """

    name: str  #: Its namespace, or, where it has none, the frame of /tf.
    namespace: str
    is_driven: bool  #: A driver has sent its controls: it is no simulated one.
    #: state, reference: STATE_FIELDS; velocities and yaw may be NaN.
    state: Rows
    reference: Rows
    control: Rows  #: CONTROL_FIELDS.
    attitude: Rows  #: POSE_FIELDS.
    battery: Rows  #: V.
    link: Rows  #: Share of answered pings, and setpoints that were not sent so far.
    toggles: Rows  #: Without fields.
    delays: Rows  #: From the stamp of the newest pose to each control, s.
    #: States that were published and not recorded; None without numbers in sequence.
    lost: int | None


def vehicle_namespaces(log: BagLog) -> list[str]:
    """Return the namespaces of the vehicles of a recording, sorted.

    A vehicle is a namespace with states or controls; if there is none, one with poses.
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
        link = np.reshape(log.events.links.get(driver, ()), (-1, 3))
        frame = _frame_of(namespace, len(namespaces) == 1, log.frames)
        yield _vehicle(namespace, sources, frame, log.frames, link)
    if not namespaces:
        for name in sorted(each for each in log.frames if _moves(log.frames[each])):
            yield _vehicle(name, [], name, log.frames, np.empty((0, 3)))


def _having(log, *roles):
    return {each.namespace for each in log.sources.values() if each.role.name in roles}


def _driver(log, namespace):
    """Return the namespace of a vehicle's driver: in the hardware example only that has one."""
    drivers = _having(log, "cmd_vel", "battery") - _having(log, "state", "final_control")
    return drivers.pop() if not namespace and len(drivers) == 1 else namespace


def _frame_of(namespace, is_alone, frames):
    name = namespace.rpartition("/")[2]
    named = [each for each in frames if name and name in each.split("/")]
    candidates = [each for each in named or (frames if is_alone else ()) if _moves(frames[each])]
    # The vehicle's own, and not that of its model.
    candidates.sort(key=lambda each: (each.endswith("base_link"), -frames[each].count))
    return candidates[0] if candidates else None


def _moves(spool: Spool) -> bool:
    """Tell whether a frame is not only another name of its parent, as base_link is."""
    return bool(spool.rows()[:, _FIRST : _FIRST + 3].any())


def _vehicle(namespace, sources, frame, frames, link):
    def rows(role, width):
        of_role = [each.spool for each in sources if each.role.name == role]
        # Of several topics the one that is used most.
        longest = max(of_role, key=lambda spool: spool.count, default=None)
        return longest.rows() if longest else np.empty((0, _FIRST + width))

    pose = rows("pose", len(POSE_FIELDS))
    if not len(pose) and frame is not None:
        pose = frames[frame].rows()
    state = rows("state", len(STATE_FIELDS))
    lost = _lost(state)
    if not len(state):
        state = _states_of(pose)
    control, cmd_vel = (rows(role, len(CONTROL_FIELDS)) for role in ("final_control", "cmd_vel"))
    is_driven = len(cmd_vel) > 0 or any(each.role.name == "battery" for each in sources)
    control = control if len(control) else cmd_vel
    return Vehicle(
        name=namespace or frame or "vehicle",
        namespace=namespace,
        is_driven=is_driven,
        state=_without_header(state),
        reference=_without_header(rows("reference", len(STATE_FIELDS))),
        control=_without_header(control),
        attitude=_without_header(pose),
        battery=_without_header(rows("battery", 1)),
        link=link,
        toggles=_without_header(rows("toggle", 0)),
        delays=_delays(control, state),
        lost=lost,
    )


def _without_header(rows: Rows) -> Rows:
    return np.delete(rows, [_STAMP, _NUMBER], axis=1)


def _states_of(poses: Rows) -> Rows:
    """Return rows of states, with velocities by central differences, of rows of poses."""
    increasing = np.r_[True, np.diff(poses[:, _TIME]) > 1e-4][: len(poses)]
    poses = poses[increasing]
    position, yaw = poses[:, _FIRST : _FIRST + 3], poses[:, -1:]
    if len(poses) < 2:
        velocity = np.zeros_like(position)
    else:
        velocity = np.gradient(position, poses[:, _TIME], axis=0)
    return np.hstack([poses[:, :_FIRST], position, velocity, yaw])


def _lost(rows: Rows) -> int | None:
    numbers = rows[:, _NUMBER]
    if not numbers.any():
        return None
    steps = np.diff(numbers)
    # A publisher that is started anew begins anew.
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
