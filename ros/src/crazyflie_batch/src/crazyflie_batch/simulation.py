"""Flights of many vehicles at once: `simulate` and its arguments."""

import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from crazyflie_batch.batch import Batch, Flights, fly
from crazyflie_batch.estimators import Estimator, FiniteDifferences
from crazyflie_batch.flight import Plan
from crazyflie_batch.per_vehicle import check_above, check_range, columns, stacked_columns
from crazyflie_lqr import linear_feedback
from crazyflie_model import inner_loops
from crazyflie_model.dynamics import STEP, Coupled7D, Dynamics, NearHover
from crazyflie_model.limits import CRASH_TILT
from crazyflie_model.stabilized_quadrotor import StabilizedQuadrotor
from crazyflie_model.units import GRAVITY

HOVER = (0.0, 0.0, 0.0, GRAVITY)  #: Feedforward control at the reference.
_ROUNDING = 1e-6  #: Tolerance of a whole number of periods, as a fraction of a period.


@dataclass(frozen=True)
class Model:
    """Vehicles of one model, whose parameters may differ."""

    #: ``make(**parameters)`` returns the `Dynamics` of one vehicle, computed by
    #: `crazyflie_model.elementwise` since it is traced with `symbols`. Compiled once for each
    #: function: no lambda.
    make: Callable[..., Dynamics]
    #: Each a float, or an array of shape (n,).
    parameters: Mapping[str, ArrayLike] = field(default_factory=dict)
    max_tilt: float = math.inf  #: See `crazyflie_simulator.vehicle.SimulatedVehicle`.


def near_hover() -> Model:
    """Return `crazyflie_model.dynamics.NearHover`."""
    return Model(NearHover)


def coupled_7d() -> Model:
    """Return `crazyflie_model.dynamics.Coupled7D`."""
    return Model(Coupled7D)


def quadrotor(
    mass_error: ArrayLike = 0.0, thrust_error: ArrayLike = 0.0, wind: ArrayLike = (0.0, 0.0, 0.0)
) -> Model:
    """Return `crazyflie_model.stabilized_quadrotor.StabilizedQuadrotor`.

    The errors are fractions > -1, floats or of shape (n,); the wind is the air's velocity, m/s,
    constant, of shape (3,) or (n, 3). ValueError: an argument is out of its range.
    """
    check_above("mass_error", mass_error, -1.0)
    check_above("thrust_error", thrust_error, -1.0)
    wind_x, wind_y, wind_z = np.moveaxis(np.asarray(wind, dtype=float), -1, 0)
    parameters = {
        "mass_error": mass_error,
        "thrust_error": thrust_error,
        "wind_x": wind_x,
        "wind_y": wind_y,
        "wind_z": wind_z,
    }
    return Model(_make_quadrotor, parameters, CRASH_TILT)


def _make_quadrotor(mass_error, thrust_error, wind_x, wind_y, wind_z):
    return StabilizedQuadrotor(
        mass_error=mass_error, thrust_error=thrust_error, wind=lambda t: (wind_x, wind_y, wind_z)
    )


@dataclass(frozen=True)
class Controller:
    """`crazyflie_lqr.linear_feedback.IntegralStateFeedback` for every vehicle, in flight.

    Each array may have one more axis in front, of length n. ValueError: a limit is negative.
    """

    K: ArrayLike  #: Shape (4, 7).
    u_ref: ArrayLike = HOVER  #: Shape (4,).
    #: integrator_k, integrator_limit: Shape (3,). The limit is >= 0.
    integrator_k: ArrayLike = (0.0, 0.0, 0.0)
    integrator_limit: ArrayLike = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        check_range("integrator_limit", self.integrator_limit, 0.0)


@dataclass(frozen=True)
class Measurement:
    """`crazyflie_simulator.vehicle.MotionCapture` for every vehicle.

    ValueError: an argument is out of its range.
    """

    #: position_noise, attitude_noise, latency, dropout: Float or array_like, shape (n,). In m, rad,
    #: s, all >= 0, and a probability.
    position_noise: ArrayLike = 0.0
    attitude_noise: ArrayLike = 0.0
    latency: ArrayLike = 0.0
    dropout: ArrayLike = 0.0

    def __post_init__(self) -> None:
        check_range("position_noise", self.position_noise, 0.0)
        check_range("attitude_noise", self.attitude_noise, 0.0)
        check_range("latency", self.latency, 0.0)
        check_range("dropout", self.dropout, 0.0, 1.0)


def simulate(
    model: Model,
    controller: Controller,
    estimator: Estimator | None = None,
    x0: ArrayLike = (0.0, 0.0, 1.0),
    n: int = 1,
    *,
    goal: ArrayLike = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0),
    duration: float = 10.0,
    period: float = 0.01,
    settle_time: float = 0.0,
    measurement: Measurement | None = None,
    seed: int = 0,
    first: int = 0,
    record: bool = False,
    threads: int | None = None,
) -> Flights:
    """Fly n vehicles in closed loop, each on its own.

    Every vehicle flies as with the nodes' own classes, to within rounding. Its flight depends on
    its number and the seed, not on how many there are.

    Parameters
    ----------
    model : Model
    controller : Controller
    estimator : Estimator, optional
        By default differences of positions.
    x0 : array_like, shape (3,) or (n, 3)
        Where they begin, at rest, m; on the ground or in the air.
    n : int
        > 0
    goal : array_like, shape (7,) or (n, 7)
        Reference: x, y, z, x_dot, y_dot, z_dot, yaw in m, m/s and rad.
    duration : float
        s, in whole periods.
    period : float
        Of motion capture, estimator and controller, s; a whole number of 2 ms.
    settle_time : float
        Errors are evaluated from this time on, s; at most the time of the last tick, ``duration -
        period``.
    measurement : Measurement, optional
        By default without errors.
    seed : int
        Of the errors of measurement.
    first : int
        Number of the first vehicle, where flights are simulated in several calls.
    record : bool
        Whether to return the states of every tick.
    threads : int, optional
        By default one for every processor.

    Raises
    ------
    ValueError
        An argument is out of its range, or an array has not one entry for every vehicle.
    TypeError
        A formula of the model cannot be computed for many vehicles; the text names it.
    """
    estimator, measurement = estimator or FiniteDifferences(), measurement or Measurement()
    if n <= 0:
        raise ValueError(f"n is {n}; expected at least one vehicle")
    if errors := time_errors(duration, period, settle_time):
        raise ValueError("; ".join(errors))
    steps, ticks = round(period / STEP), round(duration / period)
    noise = {name: getattr(measurement, name) for name in ("position_noise", "attitude_noise")}
    # A longer delay makes no difference: the pose arrives after the end.
    latency = np.asarray(measurement.latency, dtype=float)
    delay = np.ceil((latency - 1e-9) / (steps * STEP)).clip(0.0, ticks)
    parameters = {
        "model": stacked_columns(model.parameters, n),
        "estimator": stacked_columns(vars(estimator), n),
        "K": columns("K", controller.K, (linear_feedback.U_DIM, linear_feedback.X_DIM), n),
        "u_ref": columns("u_ref", controller.u_ref, (linear_feedback.U_DIM,), n),
        "integrator_k": columns("integrator_k", controller.integrator_k, (3,), n),
        "integrator_limit": columns("integrator_limit", controller.integrator_limit, (3,), n),
        "goal": columns("goal", goal, (linear_feedback.X_DIM,), n),
        "noise": stacked_columns(noise, n),
        "delay": columns("latency", delay, (), n),
        "dropout": columns("dropout", measurement.dropout, (), n),
        "settled": columns("settle_time", math.ceil(settle_time / period - _ROUNDING), (), n),
    }
    dims = {name: len(rows) for name, rows in parameters.items()}
    plan = Plan(model.make, tuple(model.parameters), model.max_tilt, type(estimator), steps, dims)
    positions = columns("x0", x0, (3,), n)
    batch = Batch(plan, parameters, _initial_states(model, positions), ticks, seed, first)
    return fly(batch, record, threads or len(os.sched_getaffinity(0)))


def time_errors(duration: float, period: float, settle_time: float) -> list[str]:
    """Return what is wrong with these arguments of `simulate`, in s."""
    samples = period / inner_loops.PERIOD
    if not 0.5 < samples < math.inf or abs(samples - round(samples)) > _ROUNDING:
        return [f"period is {period:g}; expected a whole number of {inner_loops.PERIOD:g} s"]
    ticks = round(duration / period) if math.isfinite(duration) else 0
    if ticks < 1:
        return [f"duration is {duration:g}; expected at least one period, {period:g} s"]
    last = (ticks - 1) * period
    if not 0.0 <= settle_time <= last + _ROUNDING * period:
        return [f"settle_time is {settle_time:g}; expected 0 to {last:g}, when the last tick is"]
    return []


def _initial_states(model, positions):
    """Return the states at rest, shape (x_dim, n)."""
    parameters = {name: np.asarray(value, float) for name, value in model.parameters.items()}
    x = model.make(**parameters).initial_state(list(positions))
    return np.array([np.broadcast_to(part, positions.shape[1:]) for part in x])
