"""Figures of a recorded flight, each with its unit and its normal range."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST
from crazyflie_model.units import GRAVITY
from crazyflie_reports.bag_flights import Flight, Rows, between
from crazyflie_reports.flight_record import (
    GAP_LIMIT,
    HOVER_TOLERANCE,
    HOVER_WINDOW,
    OVERSHOOT_LIMIT,
    TOUCHDOWN_LIMIT,
)
from crazyflie_reports.usd_overlay import position

#: Largest distance of a real or virtual vehicle from its hover point, m: motion capture, trim and
#: propellers are not ideal.
HARDWARE_TOLERANCE = 0.05

#: Shortest time at the hover point (s): a vehicle that leaves it earlier does not hover.
SHORTEST_HOVER = 1.0
HOVER_TIME_LIMIT = 8.0  #: 1 s of open loop, 5 s of hover of the takeoff server, 2 s more (s).
TRACKING_LIMIT = 0.2  #: Largest distance from a moving reference, m.
DELAY_LIMIT = 0.02  #: Time within which 95 % of the controls follow the pose (s).
LEAST_RATE = 50.0  #: Lowest rate of states and controls; velocities are poor below it (Hz).
#: Mean change of roll and pitch from one control to the next (rad). It holds for gains with enough
#: margin; those at the limit of stability reach ten times as much.
CHANGE_LIMIT, HARDWARE_CHANGE_LIMIT = 0.01, 0.03
SATURATED_LIMIT = 0.01  #: Largest fraction of controls at a limit.
_ROUNDING = 1e-6  #: Rounding error of a control that was sent in degrees (rad).
#: Thrust in hover over g: a sagging battery explains a part, a wrong mass or thrust curve more.
HOVER_LIMITS = (0.85, 1.15)
#: Largest delay of roll and pitch behind their commands (s): the firmware's loops take 0.19 s.
LATENESS_LIMIT = 0.25
_MAX_LATENESS, _LEAST_POSES, _LEAST_CORRELATION = 0.5, 200, 0.5
LEAST_VOLTAGE = 3.2  #: Lowest voltage of one lithium polymer cell under load (V).

_LANDING = "a landing on the ground at z = 0"
_STAMPS = "states with stamps of the recording's clock"
_HOVER = "a takeoff, and a hover of 1 s at its reference"
_TRACKING = "states and references while the controller flies"
_CONTROL, _STATE, _BATTERY = "controls in flight", "states in flight", "battery voltages"
_TILTS = "3 s of controls and poses with an attitude, and motion"
_TRUTH = "true_pose, which a virtual vehicle publishes"
_STATUS = "vehicle_status, which a driver publishes"


@dataclass(frozen=True)
class Figure:
    """A number that describes a flight."""

    name: str
    unit: str
    value: float  #: NaN if it is not known.
    #: Topic or flight from which it is known. minimum, maximum: Limits of the normal range, if any.
    needs: str
    minimum: float = -math.inf
    maximum: float = math.inf
    note: str = ""  #: Explanation for readers.

    @property
    def is_normal(self) -> bool:
        """Whether the value is normal, or not known."""
        return math.isnan(self.value) or self.minimum <= self.value <= self.maximum

    @property
    def normal(self) -> str:
        """The normal range in words; empty without one."""
        if math.isfinite(self.minimum) and math.isfinite(self.maximum):
            return f"{self.minimum:.3g} to {self.maximum:.3g} {self.unit}"
        if math.isfinite(self.minimum):
            return f"≥ {self.minimum:g} {self.unit}"
        return f"≤ {self.maximum:g} {self.unit}".strip() if math.isfinite(self.maximum) else ""


def hover_point(flight: Flight) -> tuple[float, float, float] | None:
    """Return the end point of a takeoff (m): the reference at the beginning of the flight."""
    reference = flight.record.reference
    before = reference.times <= flight.record.events["flying"] + 0.5
    if not before.any() or flight.phases[0].name != "taking off":
        return None
    x, y, z = reference.values[before][-1, :3]
    return float(x), float(y), float(z)


def figures(flight: Flight) -> list[Figure]:
    """Return the figures of a flight, always the same ones in the same order."""
    return [
        *_hover(flight),
        *_tracking(flight),
        _drift(flight),
        *_motion(flight),
        *_controls(flight),
        *_loop(flight),
        *_link(flight),
    ]


def figures_of_motion(flight: Flight) -> list[Figure]:
    """Return those of the `figures` that follow from states, references and controls."""
    return [*_hover(flight), *_tracking(flight), *_motion(flight), *_controls(flight)]


def _hover(flight: Flight) -> Iterator[Figure]:
    record, point = flight.record, hover_point(flight)
    tolerance = HARDWARE_TOLERANCE if flight.vehicle.is_driven else HOVER_TOLERANCE
    time = over = mean = largest = math.nan
    begin, end = record.hover_interval(point) if point is not None else (0.0, 0.0)
    if point is not None and end - begin >= SHORTEST_HOVER:
        time = record.time_to_hover(point, tolerance)
        over = record.overshoot(point)
        # A vehicle that leaves early has settled within the window.
        if time <= HOVER_TIME_LIMIT:
            begin = max(begin, record.events["takeoff"] + time)
        try:
            mean, largest = record.hover_error(point, min(HOVER_WINDOW, end - begin))
        except ValueError:
            pass  # The states had ended before.
    yield Figure("time to hover", "s", time, _HOVER, maximum=HOVER_TIME_LIMIT)
    yield Figure("overshoot", "mm", 1e3 * over, _HOVER, maximum=1e3 * OVERSHOOT_LIMIT)
    yield Figure("hover error, mean", "mm", 1e3 * mean, _HOVER, maximum=1e3 * tolerance)
    yield Figure("hover error, maximum", "mm", 1e3 * largest, _HOVER, maximum=1e3 * tolerance)


def _tracking(flight: Flight) -> Iterator[Figure]:
    times, errors = flight.record.tracking_errors()
    # Takeoff and landing have other references, or none.
    phases = _controlled(flight)
    flown = np.any([(times >= p.start) & (times <= p.end) for p in phases], axis=0)
    errors = 1e3 * errors[flown] if phases else errors[:0]
    rms = math.sqrt(_of(np.mean, errors**2))
    share = _percentile(errors, 95)
    yield Figure("error in flight, rms", "mm", rms, _TRACKING, maximum=500.0 * TRACKING_LIMIT)
    yield Figure("error in flight, 95 %", "mm", share, _TRACKING, maximum=1e3 * TRACKING_LIMIT)
    yield Figure("error in flight, maximum", "mm", _of(np.max, errors), _TRACKING)


def _drift(flight: Flight) -> Figure:
    state, truth = flight.record.state, flight.vehicle.true_pose
    times = state.times[(state.times >= flight.start) & (state.times <= flight.end)]
    drift = math.nan
    if len(times) and len(truth) > 1:
        times = times[(times >= truth[0, 0]) & (times <= truth[-1, 0])]
        true = np.column_stack([np.interp(times, truth[:, 0], truth[:, k]) for k in (1, 2, 3)])
        estimated = state.values[np.searchsorted(state.times, times), :3]
        drift = 1e3 * _of(np.max, np.linalg.norm(estimated - true, axis=1))
    return Figure("drift of the estimate, maximum", "mm", drift, _TRUTH)


def _motion(flight: Flight) -> Iterator[Figure]:
    record = flight.record
    state = record.state.between(flight.start, flight.end)
    speed = np.linalg.norm(state[:, 3:6], axis=1)
    control = flight.during(record.final_control.rows)
    tilt = np.abs(control[:, 1:3]).max(axis=1, initial=-math.inf)
    seconds = np.diff(control[:, 0])
    impulse = float(seconds @ control[:-1, 4]) / GRAVITY if len(control) > 1 else math.nan
    touchdown = record.touchdown_speed()
    yield Figure("touchdown speed", "m/s", touchdown, _LANDING, maximum=TOUCHDOWN_LIMIT)
    yield Figure("duration", "s", flight.end - flight.start, "a flight")
    yield Figure("height, maximum", "m", _of(np.max, state[:, 2]), _STATE)
    yield Figure("speed, maximum", "m/s", _of(np.max, speed), "velocities in flight")
    # Largest roll or pitch; a limited control has exactly the limit.
    degrees, limit = (round(math.degrees(each), 3) for each in (_of(np.max, tilt), MAX_TILT))
    note = "the limit to which every control is cut"
    yield Figure("tilt commanded, maximum", "deg", degrees, _CONTROL, maximum=limit, note=note)
    yield Figure("thrust used, as time of hover", "s", impulse, _CONTROL)
    yield Figure("thrust, mean", "m/s²", impulse * GRAVITY / (flight.end - flight.start), _CONTROL)


def _controls(flight: Flight) -> Iterator[Figure]:
    """Yield figures of the controls while the controller flies, and of the vehicle's answers."""
    phases = _controlled(flight)
    parts = [flight.record.final_control.between(each.start, each.end) for each in phases]
    # Changes between two phases are not included.
    steps = [np.abs(np.diff(each[:, :2], axis=0)).ravel() for each in parts]
    changes = np.concatenate([np.empty(0), *steps])
    control = np.concatenate([np.empty((0, 4)), *parts])
    tilt, thrust = np.abs(control[:, :2]).max(axis=1), control[:, 3]
    saturated = (tilt >= MAX_TILT - _ROUNDING) | (thrust >= MAX_THRUST) | (thrust <= MIN_THRUST)
    change, share = _of(np.mean, changes), 100.0 * _of(np.mean, saturated)
    limit = HARDWARE_CHANGE_LIMIT if flight.vehicle.is_driven else CHANGE_LIMIT
    yield Figure("roll and pitch, mean change per control", "rad", change, _CONTROL, maximum=limit)
    yield Figure("controls saturated", "%", share, _CONTROL, maximum=100.0 * SATURATED_LIMIT)
    hint = "otherwise the vehicle is not its model: ./run identify BAG finds it"
    low, high = (factor * GRAVITY for factor in HOVER_LIMITS)
    yield Figure("thrust in hover", "m/s²", _of(np.median, thrust), _CONTROL, low, high, note=hint)
    late = np.array([_lateness(flight, each.start, each.end) for each in phases])
    name, limit = "roll and pitch behind their commands", 1e3 * LATENESS_LIMIT
    yield Figure(name, "ms", 1e3 * _of(np.median, late), _TILTS, maximum=limit, note=hint)


def _lateness(flight, start, end):
    """Return the delay of roll and pitch behind their commands (s), by their correlation.

    NaN without a correlation: without motion, noise exceeds the commands.
    """
    poses = between(flight.vehicle.attitude, start, end)
    commands = between(flight.record.final_control.rows, start, end)
    if len(poses) < _LEAST_POSES:
        return math.nan
    found = position(commands[:, :3], poses[:, [0, 4, 5]], (0.0, _MAX_LATENESS))
    return found.offset if found and found.correlation > _LEAST_CORRELATION else math.nan


def _loop(flight: Flight) -> Iterator[Figure]:
    delays = 1e3 * flight.during(flight.vehicle.delays)[:, 1]
    for part, share, limit in (("median", 50, math.inf), ("95 %", 95, 1e3 * DELAY_LIMIT),
                               ("maximum", 100, math.inf)):  # fmt: skip
        name = f"delay pose to control, {part}"
        yield Figure(name, "ms", _percentile(delays, share), _STAMPS, maximum=limit)
    for name, series in (("state", flight.record.state), ("control", flight.record.final_control)):
        times = flight.during(series.rows)[:, 0]
        # From the first message to the end of the flight, even if the messages ended earlier.
        steps = np.diff([*times, flight.end]) if len(times) else times
        rate = 1.0 / float(steps.mean()) if steps.any() else math.nan
        gap, needs = 1e3 * _of(np.max, steps), f"{name}s in flight"
        yield Figure(f"{name} rate", "Hz", rate, needs, minimum=LEAST_RATE)
        yield Figure(f"{name} gap, longest", "ms", gap, needs, maximum=1e3 * GAP_LIMIT)
    lost = math.nan if flight.vehicle.lost is None else float(flight.vehicle.lost)
    yield Figure(
        "states not recorded", "", lost, "numbers in sequence in the states' headers", maximum=0.0
    )


def _link(flight: Flight) -> Iterator[Figure]:
    link = flight.during(flight.vehicle.link)
    unanswered = 100.0 * (1.0 - _of(np.mean, link[:, 1]))
    blocked = float(link[-1, 2] - link[0, 2]) if len(link) else math.nan
    yield Figure("packets lost", "%", unanswered, _STATUS, maximum=5.0)
    yield Figure("setpoints not sent", "", blocked, _STATUS, maximum=0.0)
    volts = flight.during(flight.vehicle.battery)[:, 1]
    drop = float(volts[0] - volts[-1]) if len(volts) else math.nan
    yield Figure("battery, lowest", "V", _of(np.min, volts), _BATTERY, minimum=LEAST_VOLTAGE)
    yield Figure("battery, drop", "V", drop, _BATTERY)


def _controlled(flight):
    """Return the phases in which the controller flies."""
    return [each for each in flight.phases if each.name == "flying"]


def _of(statistic: Callable[[Rows], float], values: Rows) -> float:
    """Return a statistic of the values that are known; NaN without any."""
    known = values[~np.isnan(values)]
    return float(statistic(known)) if len(known) else math.nan


def _percentile(values, share):
    return _of(lambda known: np.percentile(known, share), values)
