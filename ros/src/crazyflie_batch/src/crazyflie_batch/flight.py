"""One vehicle's flight, tick by tick, by components: for floats or a batch.

A tick is one control period of a graph of nodes without delays of its own: motion capture measures
the pose, a pose arrives, estimator and controller compute a control, and the vehicle flies with the
last control.

Memory and parameters of a vehicle are dictionaries of names to lists of components; see
`Plan.memory_dims` and `Plan.parameter_dims`.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

from crazyflie_batch.estimators import Estimator
from crazyflie_lqr import linear_feedback
from crazyflie_model.angles import turned
from crazyflie_model.dynamics import STEP, Dynamics, watchdog_control
from crazyflie_model.elementwise import Number, Vector, functions, where

_SMALLEST_COSINE = 1e-6  #: Cosine of the pitch below which roll and yaw are not distinct.


def yaw_from_quaternion(quaternion: Sequence[Number]) -> Number:
    """Return the yaw of `crazyflie_model.angles.rpy_from_quaternion`, rad."""
    x, y, z, w = quaternion
    f = functions(x)
    s = 2.0 / (x * x + y * y + z * z + w * w)
    r00 = 1.0 - s * (y * y + z * z)
    r01 = s * (x * y - w * z)
    r10 = s * (x * y + w * z)
    r11 = 1.0 - s * (x * x + z * z)
    is_singular = f.hypot(r00, r01) < _SMALLEST_COSINE
    return where(is_singular, f.atan2(r10, r11), f.atan2(-r01, r00))


#: Random numbers of a tick: noise of position (3) and attitude (3), of standard deviation 1; and
#: one in [0, 1), by which a pose is lost.
NOISE_DIM = 7

POSE_DIM = 5  #: Components of a delayed pose: position (3), yaw, and 1 for one that is not lost.

#: Metrics of a flight: largest distance from the goal, m, and sum of the squared
#: distances at the ticks after it has settled; of all ticks, the least cosine of the tilt and the
#: largest speed, m/s.
METRICS = ("largest_error", "squared_errors", "least_upright", "largest_speed")


Components = dict[str, Vector[Any]]


def components(rows: Iterable[Any], dims: Mapping[str, int]) -> Components:
    """Return rows by name; ``dims`` are the numbers of consecutive rows."""
    rest = iter(rows)
    return {name: list(islice(rest, dim)) for name, dim in dims.items()}


@dataclass(frozen=True)
class Plan:
    """Model, controller and estimator of all flights of a batch."""

    #: ``make_model(**parameters)`` returns the `Dynamics` of one vehicle, by the names in
    #: ``model_parameters``.
    make_model: Callable[..., Dynamics]
    model_parameters: tuple[str, ...]
    #: A vehicle that is tilted more than this, rad, has crashed, and its motors stop.
    max_tilt: float
    estimator: type[Estimator]
    steps: int  #: Steps of the model in a tick, a multiple of `STEPS_PER_SAMPLE`.
    #: Numbers that differ between vehicles: name to number of rows.
    parameter_dims: Mapping[str, int] = field(compare=False)

    @property
    def period(self) -> float:
        """Period of a tick (s)."""
        return self.steps * STEP

    def memory_dims(self) -> dict[str, int]:
        """Return the memory of a flight: name to number of rows."""
        x_dim = self.make_model(**dict.fromkeys(self.model_parameters, 0.0)).x_dim
        start = self.initial_memory([0.0] * x_dim)
        return {name: len(part) for name, part in start.items()}

    def model(self, parameters: Components) -> Dynamics:
        """Return the model of one vehicle."""
        return self.make_model(**dict(zip(self.model_parameters, parameters["model"], strict=True)))

    def initial_memory(self, x: Vector[Any]) -> Components:
        """Return the memory of a flight that begins at a state of the model."""
        return {
            "tick": [0.0],
            "x": x,
            "u": [0.0] * linear_feedback.U_DIM,
            "age": [0.0],
            "has_crashed": [0.0],
            "estimator": [0.0] * self.estimator.memory_dim,
            "stamp": [-1.0],
            "integral": [0.0] * 3,
            "control_stamp": [-1.0],
            "metrics": [0.0, 0.0, 1.0, 0.0],
        }


def effective_control(memory: Components) -> Vector[Any]:
    """Return the control in effect: the last one while it is new, then that of the watchdog.

    See `crazyflie_simulator.vehicle.SimulatedVehicle`.
    """
    (age,), (has_crashed,) = memory["age"], memory["has_crashed"]
    return [where(has_crashed > 0.0, 0.0, part) for part in watchdog_control(memory["u"], age)]


def measure(
    plan: Plan, memory: Components, parameters: Components, noise: Vector[Any]
) -> Vector[Any]:
    """Return the pose that motion capture sends off, `POSE_DIM` components.

    See `crazyflie_simulator.vehicle.MotionCapture`.
    """
    position, attitude = plan.model(parameters).pose(memory["x"], effective_control(memory))
    position_noise, attitude_noise = parameters["noise"]
    (dropout,) = parameters["dropout"]
    measured = [a + position_noise * b for a, b in zip(position, noise[:3], strict=True)]
    rotation = turned(attitude, [attitude_noise * part for part in noise[3:6]])
    is_lost = noise[6] < dropout
    return [*measured, yaw_from_quaternion(rotation), where(is_lost, 0.0, 1.0)]


def run_controller(
    plan: Plan, memory: Components, parameters: Components, pose: Vector[Any]
) -> Components:
    """Return the memory after estimator and controller have processed a pose, if one has arrived.

    The pose has `POSE_DIM` components and was measured before the vehicle's delay. The tick ends.
    """
    *position, yaw, has_arrived = pose
    (stamp,), (control_stamp,) = memory["stamp"], memory["control_stamp"]
    (now,), (delay,) = memory["tick"], parameters["delay"]
    tick = now - delay
    has_arrived = has_arrived > 0.0
    is_second = has_arrived & (stamp >= 0.0)

    # In whole nanoseconds, as stamps are.
    dt = (tick - stamp) * round(plan.period * 1e9) * 1e-9
    begun = plan.estimator.start(position, parameters["estimator"])
    filtered, position, velocity = plan.estimator.update(
        memory["estimator"], dt, position, parameters["estimator"]
    )
    state = [*position, *velocity, yaw]

    k = parameters["integrator_k"]
    dt = where(control_stamp >= 0.0, tick * plan.period - control_stamp * plan.period, 0.0)
    dt = where(dt <= linear_feedback.MAX_GAP, dt, 0.0)
    error = linear_feedback.heading_error(state, parameters["goal"])
    rows = [
        parameters["K"][i : i + linear_feedback.X_DIM] for i in range(0, 28, linear_feedback.X_DIM)
    ]
    linear = linear_feedback.linear_control(rows, parameters["u_ref"], error)
    integral = [
        linear_feedback.integrate(axis, before, error[axis], dt, linear, k[axis], limit)
        for axis, (before, limit) in enumerate(
            zip(memory["integral"], parameters["integrator_limit"], strict=True)
        )
    ]
    u = linear_feedback.limited(linear_feedback.with_integrals(linear, integral, k))
    memory = {**memory, "tick": [now + 1.0]}
    first = _choose(has_arrived, {"estimator": begun, "stamp": [tick]}, memory)
    return _choose(
        is_second,
        {
            "estimator": filtered,
            "stamp": [tick],
            "integral": integral,
            "u": u,
            "control_stamp": [tick],
            "age": [0.0],
        },
        first,
    )


def step(plan: Plan, memory: Components, parameters: Components, count: int) -> Components:
    """Return the memory one `STEP` later; ``count`` is that of the steps since a sample."""
    model = plan.model(parameters)
    x = model.step(count, memory["x"], effective_control(memory))
    (age,), (control_stamp,) = memory["age"], memory["control_stamp"]
    # A vehicle stays put until its first control.
    memory = _choose(control_stamp >= 0.0, {"x": x, "age": [age + 1.0]}, memory)
    if math.isinf(plan.max_tilt):
        return memory
    is_tilted = _upright(model, memory) < math.cos(plan.max_tilt)
    return _choose(is_tilted, {"has_crashed": [1.0]}, memory)


def update_metrics(plan: Plan, memory: Components, parameters: Components) -> Components:
    """Return the memory with the metrics as they are after this tick; see `METRICS`."""
    largest, squares, upright, fastest = memory["metrics"]
    (tick,), (settled,) = memory["tick"], parameters["settled"]
    x, goal = memory["x"], parameters["goal"]
    root = functions(x[0]).sqrt
    squared = sum((x[axis] - goal[axis]) ** 2 for axis in range(3))
    counts = tick >= settled
    error, speed = root(squared), root(sum(part**2 for part in x[3:6]))
    present = _upright(plan.model(parameters), memory)
    metrics = [
        where(counts & (error > largest), error, largest),
        squares + where(counts, squared, 0.0),
        where(present < upright, present, upright),
        where(speed > fastest, speed, fastest),
    ]
    return {**memory, "metrics": metrics}


def _upright(model, memory):
    """Return the cosine of the tilt."""
    _, (x, y, _, _) = model.pose(memory["x"], effective_control(memory))
    return 1.0 - 2.0 * (x * x + y * y)


def _choose(condition, values, others):
    """Return ``others``, with ``values`` in their place where a condition holds."""
    chosen = {
        name: [where(condition, a, b) for a, b in zip(part, others[name], strict=True)]
        for name, part in values.items()
    }
    return {**others, **chosen}
