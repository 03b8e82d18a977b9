"""How good the velocities of the filters are, on simulated flights.

    python3 -m crazyflie_dev.velocity_study docs/images/velocity_filter.png

measures the filters, prints a table and draws a figure.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.signal import lfilter

from crazyflie_model.angles import rotate_by_yaw
from crazyflie_model.dynamics import coupled_acceleration
from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST
from crazyflie_model.units import GRAVITY
from crazyflie_state_estimator.control_input import ControlInput
from crazyflie_state_estimator.kalman import (
    ACCELERATION_WALK,
    ACCELERATION_WALK_WITH_CONTROL,
    POSITION_NOISE,
    ConstantAccelerationFilter,
)
from crazyflie_state_estimator.motion import MotionEstimator
from crazyflie_state_estimator.rate_filter import FiniteDifference, RateFilter

PERIOD = 0.01  #: Time between two poses, s.
NOISE = 0.001  #: Standard deviation of the poses' coordinates, m.

_SETTLED = slice(round(1.0 / PERIOD), None)
_STEP = 0.001
_YAW_RATE = 0.3
_LEG = 3.0
_WAYPOINTS = np.array([(0, 0, 1), (0, 0, 1), (1, 0, 1), (1, 1, 1.5), (-1, 0.5, 0.7)], dtype=float)


@dataclass(frozen=True)
class ModelError:
    """How a vehicle differs from the model that follows its controls at once."""

    response_time: float = 0.0  #: Time constant of attitude and thrust, s.
    thrust_factor: float = 1.0  #: Thrust per commanded thrust.
    drag: float = 0.0  #: Deceleration per speed, 1/s.
    #: Standard deviation of the wind's acceleration, m/s^2, which is correlated over 1 s.
    gusts: float = 0.0


IDEAL = ModelError()
REAL = ModelError(response_time=0.05, thrust_factor=0.9, drag=0.2, gusts=0.3)


@dataclass(frozen=True)
class SampledFlight:
    """A flight, sampled every `PERIOD`; n samples."""

    #: position, velocity: Shape (n, 3). The truth, m and m/s.
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    yaw: NDArray[np.float64]  #: Shape (n,); rad.
    control: NDArray[np.float64]  #: Shape (n, 4). Given at each sample and held until the next.
    measured: NDArray[np.float64]  #: Shape (n, 3). Position with noise, m.

    @property
    def time(self) -> NDArray[np.float64]:
        """Time of the samples, s, shape (n,)."""
        return PERIOD * np.arange(len(self.yaw), dtype=float)


def fly(vehicle: ModelError, duration: float, seed: int = 0) -> SampledFlight:
    """Return a flight: hover, then steps between waypoints, 1 to 2.2 m apart, while turning.

    ``duration`` is in s; ``seed`` is that of wind and noise. The controller has the true state, so
    all filters see the same flight.
    """
    rng = np.random.default_rng(seed)
    samples, steps = round(duration / PERIOD), round(PERIOD / _STEP)
    gusts = _correlated_noise(rng, samples * steps, vehicle.gusts)
    follow = 1.0 - np.exp(-_STEP / vehicle.response_time) if vehicle.response_time else 1.0
    position, yaw = _WAYPOINTS[0].copy(), 0.0
    velocity: NDArray[np.float64] = np.zeros(3)
    acting: NDArray[np.float64] = np.array([0.0, 0.0, 0.0, GRAVITY])
    log = []
    for k in range(samples):
        control = _control(k * PERIOD, position, velocity, yaw)
        log.append((position, velocity, yaw, control))
        target = control * [1.0, 1.0, 1.0, vehicle.thrust_factor]
        for i in range(steps):
            acting = acting + follow * (target - acting)
            acceleration = np.array(coupled_acceleration(acting.tolist(), yaw))
            acceleration += gusts[k * steps + i] - vehicle.drag * velocity
            position = position + _STEP * velocity + 0.5 * _STEP**2 * acceleration
            velocity = velocity + _STEP * acceleration
            yaw += _STEP * control[2]
    positions, velocities, yaws, controls = map(np.array, zip(*log, strict=True))
    measured = positions + NOISE * rng.normal(size=positions.shape)
    return SampledFlight(positions, velocities, yaws, controls, measured)


def _control(time, position, velocity, yaw):
    waypoint = _WAYPOINTS[int(time / _LEG) % len(_WAYPOINTS)]
    error = position - waypoint
    x, y = 0.25 * error[:2] + 0.25 * velocity[:2]
    forward, left = rotate_by_yaw(x, y, -yaw)
    thrust = GRAVITY - 1.5 * error[2] - 1.0 * velocity[2]
    roll, pitch = np.clip([left, -forward], -MAX_TILT, MAX_TILT)
    return np.array([roll, pitch, _YAW_RATE, np.clip(thrust, MIN_THRUST, MAX_THRUST)])


def _correlated_noise(rng, steps, deviation):
    """Return noise that is correlated over 1 s, shape (steps, 3); the first row is 0."""
    drive = deviation * np.sqrt(2.0 * _STEP) * rng.normal(size=(steps - 1, 3))
    return np.vstack([np.zeros(3), lfilter([1.0], [1.0, _STEP - 1.0], drive, axis=0)])


#: Name -> filter with the nodes' defaults, and whether it is given the control.
FILTERS: dict[str, tuple[Callable[[], RateFilter], bool]] = {
    "finite difference": (FiniteDifference, False),
    "Kalman": (partial(ConstantAccelerationFilter, POSITION_NOISE, ACCELERATION_WALK), False),
    "Kalman with control": (
        partial(ConstantAccelerationFilter, POSITION_NOISE, ACCELERATION_WALK_WITH_CONTROL),
        True,
    ),
}


def estimate(
    flight: SampledFlight, make_filter: Callable[[], RateFilter], uses_control: bool
) -> NDArray[np.float64]:
    """Return the velocities (n, 3), m/s, that a filter finds; 0 at the first sample."""
    estimator, control = MotionEstimator(make_filter(), FiniteDifference()), ControlInput()
    velocity = np.zeros_like(flight.measured)
    for k, (time, position, yaw) in enumerate(
        zip(flight.time, flight.measured, flight.yaw, strict=True)
    ):
        acceleration = control.acceleration(yaw, time)
        motion = estimator.update(round(time * 1e9), position, (0.0, 0.0, yaw), acceleration)
        if motion is not None:
            velocity[k] = motion.velocity
        if uses_control:
            control.command(flight.control[k], time)
    return velocity


def rms_error(flight: SampledFlight, velocity: NDArray[np.float64]) -> float:
    """Return the root mean square of the velocity error, m/s, over all but the first second."""
    return float(np.sqrt(np.mean((velocity - flight.velocity)[_SETTLED] ** 2)))


def lag(flight: SampledFlight, velocity: NDArray[np.float64]) -> float:
    """Return by how much, in s, the true velocity has to be delayed to fit an estimate best."""
    shifts = np.arange(-0.03, 0.1, 0.0005)
    misfits = []
    for shift in shifts:
        delayed = [np.interp(flight.time - shift, flight.time, axis) for axis in flight.velocity.T]
        misfits.append(np.mean((velocity - np.transpose(delayed))[_SETTLED] ** 2))
    return float(shifts[np.argmin(misfits)])


def draw(
    flight: SampledFlight,
    velocities: dict[str, NDArray[np.float64]],
    path: str,
    start: float,
    end: float,
) -> None:
    """Draw x_dot of a flight, and its errors, between two times (s) into a file.

    ``velocities`` are those that the filters found, by name, shape (n, 3).
    """
    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(4, 3))
    part = slice(round(start / PERIOD), round(end / PERIOD) + 1)
    time, truth = flight.time[part], flight.velocity[part, 0]
    styles = zip(velocities, ("#c4c4c4", "#e07b00", "#0b62b0"), (0.9, 1.5, 1.5), strict=True)
    for name, color, width in styles:
        estimated = velocities[name][part, 0]
        error = 1e3 * rms_error(flight, velocities[name])
        top.plot(
            time, estimated, color=color, lw=width, label=f"{name}, {error:.0f} mm/s RMS error"
        )
        bottom.plot(time, estimated - truth, color=color, lw=width)
    top.plot(time, truth, color="black", lw=1.2, ls="--", label="truth")
    top.set_ylabel("x velocity, m/s")
    top.legend(loc="upper right", framealpha=0.95)
    top.set_title(
        f"Velocity from poses at {1.0 / PERIOD:.0f} Hz with {1e3 * NOISE:.0f} mm of noise: "
        "hover, and a step of 1 m",
        loc="left",
    )
    bottom.axhline(0.0, color="black", lw=0.8, ls="--")
    bottom.set_ylabel("error, m/s (enlarged)")
    bottom.set_ylim(-0.1, 0.1)
    bottom.set_yticks([-0.1, -0.05, 0.0, 0.05, 0.1])
    bottom.set_xlabel("time, s")
    bottom.set_xlim(start, end)
    for axes in (top, bottom):
        axes.grid(color="#e6e6e6")
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=120)


def main() -> None:
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description="Compare the velocity filters on a flight.")
    parser.add_argument("figure", help="file to draw into, such as velocity_filter.png")
    path = parser.parse_args().figure
    flight = fly(REAL, 60.0)
    velocities = {name: estimate(flight, *filter_) for name, filter_ in FILTERS.items()}
    print(f"{'filter':24}{'RMS error, mm/s':>17}{'lag, ms':>10}")
    for name, velocity in velocities.items():
        error, delay = 1e3 * rms_error(flight, velocity), 1e3 * lag(flight, velocity)
        print(f"{name:24}{error:17.1f}{delay:10.1f}")
    draw(flight, velocities, path, start=5.0, end=9.0)


if __name__ == "__main__":
    main()
