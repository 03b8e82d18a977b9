"""The model of a vehicle, fitted to commands and poses by least squares.

The model is that of `crazyflie_model.first_order_quadrotor`, with the delay of the vehicle, its
trims, and the error of the attitude that motion capture sees. Predicted attitudes and positions are
compared with measured ones ("output error"): the commands are known, and noise is in the poses
alone. Positions and headings are compared in windows, each with a position, velocity and heading of
its own, so that a gust is forgotten.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import lfilter

from crazyflie_model.first_order_quadrotor import TILT_LAG
from crazyflie_model.limits import FULL_PWM
from crazyflie_model.quadrotor import QuadrotorParameters
from crazyflie_model.units import GRAVITY

Array = NDArray[np.float64]

STEP = 0.002  #: Step of the prediction, s.
WINDOW = 3.0  #: Length of a window, s.
SETTLING = 1.0  #: Time after which the attitude at the beginning is forgotten, s.
LEAST_TIME = 15.0  #: Shortest flight from which a model is fitted, s.
USED = 0.7  #: Share of the flight to which the model is fitted; the rest tests it.

#: Names of the fitted figures, in their order.
NAMES = (
    "mass", "thrust slope", "delay", "roll lag", "pitch lag", "yaw lag", "motor time constant",
    "drag", "roll trim", "pitch trim", "roll offset", "pitch offset",
)  # fmt: skip
UNITS = ("kg", "", "s", "s", "s", "s", "s", "1/s", "rad", "rad", "rad", "rad")

_MAX_EVALUATIONS = 40  #: Largest number of iterations of a fit; informative flights need about ten.

#: Typical sizes, by which the fit scales them: units of `UNITS`.
_SCALES = np.array([0.03, 0.1, 0.02, 0.1, 0.1, 0.1, 0.05, 0.1, 0.02, 0.02, 0.02, 0.02])
_LOW = np.array([0.005, -2.0, -0.05, 0.002, 0.002, 0.002, 0.002, -1.0, -0.3, -0.3, -0.3, -0.3])
_HIGH = np.array([2.0, 2.0, 0.3, 1.0, 1.0, 1.0, 0.5, 5.0, 0.3, 0.3, 0.3, 0.3])

#: Largest standard errors with which a figure is known, in its unit (mass: of its value), and what
#: to fly where it is larger.
_TELLS = {
    "mass": (0.02, "hover, and climb and sink by some cm"),
    "thrust slope": (0.3, "climb and sink by some cm, twice a second"),
    "delay": (0.01, "tilt by some degrees, twice a second and faster"),
    "roll lag": (0.02, "move left and right by some cm, once to four times a second"),
    "pitch lag": (0.02, "move ahead and back by some cm, once to four times a second"),
    "yaw lag": (0.04, "turn to and fro by some degrees, once to three times a second"),
    "motor time constant": (0.04, "climb and sink by some cm, twice a second and faster"),
    "drag": (0.1, "fly to and fro at 0.4 m/s and faster"),
    "roll trim": (0.01, "hover for longer"),
    "pitch trim": (0.01, "hover for longer"),
}


class IdentificationError(Exception):
    """A flight is not informative enough for the model; the text says what is missing."""


@dataclass(frozen=True)
class Recording:
    """Commands and poses of a flight, both from before to after it.

    A command holds until the next one; times are in s, on one clock.
    """

    command_times: Array  #: When commands were sent, shape (n,).
    #: Roll and pitch (rad), yaw rate (rad/s, counter-clockwise), thrust (PWM), shape (n, 4).
    commands: Array
    pose_times: Array  #: When poses were measured, shape (m,).
    #: x, y, z (m), roll, pitch, yaw (rad, Z-Y-X), shape (m, 6); for `fitted` and what compares
    #: with it, the yaw goes on where it passes pi.
    poses: Array

    def between(self, start: float, end: float) -> "Recording":
        """Return the poses of a part, s, with all commands."""
        inside = (self.pose_times >= start) & (self.pose_times <= end)
        return replace(self, pose_times=self.pose_times[inside], poses=self.poses[inside])


@dataclass(frozen=True)
class Fit:
    """A fitted model."""

    model: QuadrotorParameters
    values: Array  #: Values of `NAMES`, shape (12,).
    errors: Array  #: Their standard errors, shape (12,).
    used: Recording  #: The part of the flight that was used.
    unused: Recording  #: The rest.
    thrust: float  #: Mean command of the flight, as a fraction of full PWM.

    def lines(self) -> list[str]:
        """Return a line for each figure: value and standard error, in handy units."""
        units = {"kg": (1e3, "g"), "s": (1e3, "ms"), "rad": (180.0 / math.pi, "deg")}
        lines = []
        for name, unit, value, error in zip(NAMES, UNITS, self.values, self.errors, strict=True):
            factor, shown = units.get(unit, (1.0, unit))
            lines.append(f"{name:20}{factor * value:9.2f} +- {factor * error:.2f} {shown}".rstrip())
        return lines


def fitted(values: Array, kind: QuadrotorParameters, thrust: float, part: Recording) -> Array:
    """Return predicted poses, shape (m, 6), with the best beginning of each window.

    ``values`` are those of `NAMES`, ``kind`` the type of the vehicle, ``thrust`` the mean command
    as a fraction.
    """
    mass, slope, delay, roll_lag, pitch_lag, yaw_lag, motor, drag, *angles = values
    roll_trim, pitch_trim, roll_offset, pitch_offset = angles
    start = part.pose_times[0] - SETTLING
    times = start + STEP * np.arange(math.ceil((part.pose_times[-1] - start) / STEP) + 2)
    held = mean_commands(part, times - delay)
    roll = _lagged(held[0] - roll_trim, roll_lag)
    pitch = _lagged(held[1] - pitch_trim, pitch_lag)
    turn = _lagged(held[2], yaw_lag)
    fraction = held[3] / FULL_PWM
    force = (kind.thrust_linear + kind.thrust_quadratic * fraction) * fraction
    force = force * (1.0 + slope * (fraction / thrust - 1.0)) * (4.0 / mass)
    lift = _lagged(np.sqrt(np.maximum(force, 0.0)), motor) ** 2
    # The heading is the predicted one, too: noise of the measured one would turn the tilt.
    turned = _integral(turn)
    yaw = np.interp(part.pose_times, times, turned)
    beginnings = _beginnings(part.poses[:, 5] - yaw, part.pose_times, 1.0 / yaw_lag)
    heading = turned + np.interp(times, part.pose_times, beginnings)
    c, s = np.cos(heading), np.sin(heading)
    ahead, left = lift * np.sin(pitch), -lift * np.sin(roll)
    vertical = drag * kind.drag_vertical / kind.drag_horizontal
    accelerations = (
        (ahead * c - left * s, drag),
        (ahead * s + left * c, drag),
        (lift * np.cos(roll) * np.cos(pitch) - GRAVITY, vertical),
    )
    columns = []
    for measured, (acceleration, rate) in zip(part.poses.T, accelerations, strict=False):
        moved = np.interp(part.pose_times, times, _moved(acceleration, rate))
        columns.append(moved + _beginnings(measured - moved, part.pose_times, rate))
    columns += [
        np.interp(part.pose_times, times, angle)
        for angle in (roll + roll_offset, pitch + pitch_offset)
    ]
    return np.column_stack([*columns, yaw + beginnings])


def mean_commands(part: Recording, times: Array) -> Array:
    """Return the mean commands of the steps that begin at these times, shape (4, len(times))."""
    ends = np.append(times, times[-1] + STEP)
    edges, held = part.command_times, np.vstack([part.commands[:1], part.commands])
    # The first command also holds before its time, the last one also after.
    edges = np.hstack([min(ends[0], edges[0]) - STEP, edges, max(ends[-1], edges[-1]) + STEP])
    areas = np.vstack([np.zeros(4), np.cumsum(held * np.diff(edges)[:, None], axis=0)])
    return np.array([np.diff(np.interp(ends, edges, column)) / STEP for column in areas.T])


def _lagged(command, lag):
    """Return a first-order response at the beginnings of the steps, settled at the first one."""
    a = math.exp(-STEP / lag)
    response, _ = lfilter([1.0 - a], [1.0, -a], command, zi=[a * command[0]])
    return np.concatenate([command[:1], response[:-1]])


def _integral(rate):
    return np.concatenate([[0.0], np.cumsum(rate[:-1] + rate[1:]) * (STEP / 2.0)])


def _moved(acceleration, drag):
    """Return the positions after an acceleration and a linear drag, 1/s, from rest at 0."""
    a = math.exp(-drag * STEP)
    gain = STEP if abs(drag) < 1e-9 else (1.0 - a) / drag
    mean = (acceleration[:-1] + acceleration[1:]) / 2.0
    velocity = np.concatenate([[0.0], lfilter([gain], [1.0, -a], mean)])
    return _integral(velocity)


def windows(times: Array) -> list[slice]:
    """Return the windows of times (s), shape (m,), each about `WINDOW` long."""
    count = max(1, round((times[-1] - times[0]) / WINDOW))
    edges = np.searchsorted(times, np.linspace(times[0], times[-1], count + 1))
    edges[-1] = len(times)
    return [slice(a, b) for a, b in zip(edges[:-1], edges[1:], strict=True) if b - a > 10]


def _beginnings(difference, times, rate):
    """Return the part of a difference, shape (m,), that the state at the window's begin explains.

    That is a value, and a speed that fades with ``rate``, 1/s.
    """
    explained = np.zeros_like(difference)
    for each in windows(times):
        t = times[each] - times[each.start]
        fade = t if abs(rate) < 1e-9 else (1.0 - np.exp(-rate * t)) / rate
        basis = np.column_stack([np.ones_like(t), fade])
        explained[each] = basis @ np.linalg.lstsq(basis, difference[each], rcond=None)[0]
    return explained


def residuals(values: Array, kind: QuadrotorParameters, thrust: float, part: Recording) -> Array:
    """Return measured minus predicted poses, shape (m, 6)."""
    return part.poses - fitted(values, kind, thrust, part)


def identify(recording: Recording, kind: QuadrotorParameters) -> Fit:
    """Return the model of a vehicle of a type that flies as the recording shows.

    `IdentificationError`: the flight is too short, or does not tell one of the figures.
    """
    # Times of day would leave too few digits for the small changes of the fit.
    origin = recording.pose_times[0] if len(recording.pose_times) else 0.0
    recording = replace(
        recording,
        command_times=recording.command_times - origin,
        pose_times=recording.pose_times - origin,
        poses=np.column_stack([recording.poses[:, :5], np.unwrap(recording.poses[:, 5])]),
    )
    times = recording.pose_times
    duration = times[-1] - times[0] if len(times) else 0.0
    if duration < LEAST_TIME:
        raise IdentificationError(
            f"the flight has {duration:.1f} s of poses and commands; expected at least "
            f"{LEAST_TIME:g} s in the air"
        )
    split = times[0] + USED * duration
    used = recording.between(times[0] + SETTLING, split)
    unused = recording.between(split, times[-1])
    flown = recording.commands[recording.commands[:, 3] > 0.0, 3]
    if not len(flown):
        raise IdentificationError(
            "the commands of the flight have no thrust; expected those by which the vehicle flies"
        )
    thrust = float(np.median(flown)) / FULL_PWM
    force = 4.0 * (kind.thrust_linear + kind.thrust_quadratic * thrust) * thrust
    lag = 0.08 if kind.roll_lag is None else kind.roll_lag
    first = np.array([force / GRAVITY, 0.0, 0.02, lag, lag, min(lag, TILT_LAG)] + [0.0] * 6)
    first[6:8] = kind.motor_time_constant, kind.drag_rates[0]
    # Attitudes are fitted first: with wrong lags, positions would mislead the fit.
    sigma = np.array([0.3] * 3 + [5e-3] * 3)
    # The noise of each channel is known after a first fit only.
    for _ in range(3):
        solution = least_squares(
            lambda x, s=sigma: (residuals(x * _SCALES, kind, thrust, used) / s).ravel(),
            np.clip(first, _LOW, _HIGH * 0.99) / _SCALES,
            bounds=(_LOW / _SCALES, _HIGH / _SCALES),
            max_nfev=_MAX_EVALUATIONS,
        )
        first = solution.x * _SCALES
        sigma = _noise(residuals(first, kind, thrust, used))
    # A parameter that changes no residual is not identifiable.
    jacobian = solution.jac
    curvature = jacobian.T @ jacobian
    covariance = np.linalg.pinv(curvature + 1e-12 * np.eye(len(NAMES)) * np.trace(curvature))
    errors = np.sqrt(np.diag(covariance)) * _SCALES
    _check(first, errors)
    return Fit(_model(first, kind, thrust), first, errors, used, unused, thrust)


def _noise(errors):
    """Return standard deviations of the channels, larger where their errors are correlated.

    Correlated errors carry less information than independent ones, by the factor 1 + 2 sum of the
    autocorrelation.
    """
    sigma = np.maximum(errors.std(axis=0), 1e-7)
    for k, column in enumerate(errors.T):
        spectrum = np.abs(np.fft.rfft(column - column.mean(), 2 * len(column))) ** 2
        correlation = np.fft.irfft(spectrum)[: len(column) // 2]
        correlation = correlation / max(correlation[0], 1e-30)
        below = np.flatnonzero(correlation < 0.05)
        end = below[0] if len(below) else len(correlation)
        sigma[k] *= math.sqrt(1.0 + 2.0 * correlation[1:end].sum())
    return sigma


def _check(values, errors):
    missing = []
    for name, (most, flight) in _TELLS.items():
        k = NAMES.index(name)
        error = errors[k] / values[k] if name == "mass" else errors[k]
        if not error <= most:
            missing.append(f"this bag does not determine {name}; {flight}")
    if missing:
        raise IdentificationError("\n".join(missing) + "\n(excite:=true flies all of this)")


def _model(values, kind, thrust):
    mass, slope, delay, roll, pitch, yaw, motor, drag, roll_trim, pitch_trim, _, _ = map(
        float, values
    )
    # The curve through 0 with this thrust and this slope at the mean command.
    a, b = kind.thrust_linear, kind.thrust_quadratic
    force, rise = (a + b * thrust) * thrust, a + 2.0 * b * thrust
    rise += slope * force / thrust
    quadratic = rise / thrust - force / thrust**2
    model = replace(
        kind,
        mass=mass,
        thrust_linear=force / thrust - quadratic * thrust,
        thrust_quadratic=quadratic,
        delay=max(0.0, delay),
        roll_lag=roll,
        pitch_lag=pitch,
        yaw_lag=yaw,
        motor_time_constant=motor,
        roll_trim=roll_trim,
        pitch_trim=pitch_trim,
    )
    per_speed = max(0.0, drag) * mass / (4.0 * model.hover_speed)
    vertical = kind.drag_vertical / kind.drag_horizontal
    return replace(model, drag_horizontal=per_speed, drag_vertical=per_speed * vertical)
