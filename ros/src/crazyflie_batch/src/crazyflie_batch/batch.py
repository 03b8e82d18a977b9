"""Flights as arrays, flown in parallel by threads."""

import math
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from crazyflie_batch import flight
from crazyflie_batch.flight import Plan
from crazyflie_batch.program import program


@dataclass(frozen=True)
class Batch:
    """Flights of n vehicles before they are flown."""

    plan: Plan
    #: Name in `Plan.parameter_dims` -> array of shape (dim, n).
    parameters: Mapping[str, NDArray[np.float64]] = field(repr=False)
    #: Shape (x_dim, n). States of the model at the beginning.
    x: NDArray[np.float64] = field(repr=False)
    ticks: int
    seed: int
    first: int  #: Number of the first vehicle.

    @property
    def n(self) -> int:
        """Number of vehicles."""
        return self.x.shape[1]

    def noise_samples(self, index: int) -> NDArray[np.float64]:
        """Return the random numbers of a vehicle's flight, shape (ticks, NOISE_DIM)."""
        random = np.random.default_rng((self.seed, self.first + index))
        normal = random.standard_normal((self.ticks, flight.NOISE_DIM - 1))
        return np.column_stack([normal, random.random(self.ticks)])


@dataclass(frozen=True)
class Flights:
    """Outcomes of n flights."""

    x: NDArray[np.float64]  #: Shape (n, x_dim). States of the model at the end.
    #: Shape (n,). Whether the vehicle has crashed, or its state has overflowed.
    has_crashed: NDArray[np.bool_]
    #: largest_error, rms_error: Shape (n,). Distance from the goal after they had time to settle,
    #: at the ticks, m.
    largest_error: NDArray[np.float64]
    rms_error: NDArray[np.float64]
    #: Shape (n,). Largest tilt from upright in the whole flight, at the ticks (rad).
    largest_tilt: NDArray[np.float64]
    #: Shape (n,). Largest speed in the whole flight, at the ticks (m/s).
    largest_speed: NDArray[np.float64]
    #: Shape (ticks, n, x_dim). States of the model at every tick; no ticks if the states were not
    #: recorded.
    states: NDArray[np.float64]
    #: Shape (ticks, n, 4). The control that was in force from every tick on.
    controls: NDArray[np.float64]


def fly(batch: Batch, record: bool, threads: int) -> Flights:
    """Return the flights; ``record`` keeps the states of all ticks."""
    plan, lanes = batch.plan, program(batch.plan).lanes
    start = plan.initial_memory(list(batch.x))
    groups = _groups(batch.n, lanes)
    memory = _grouped([part for row in start.values() for part in row], groups, batch.n)
    parameters = _grouped(np.concatenate([*batch.parameters.values()]), groups, batch.n)
    rows = batch.ticks if record else 0
    records = np.empty((len(memory), rows, *memory.shape[1:]))
    slots = int(batch.parameters["delay"].max()) + 1
    no_noise = np.zeros((batch.ticks, flight.NOISE_DIM, lanes))
    no_noise[:, -1] = 1.0
    is_random = batch.parameters["noise"].any() or batch.parameters["dropout"].any()

    def fly_group(group):
        noise = no_noise
        if is_random:
            samples = [batch.noise_samples(vehicle) for vehicle in groups[group].tolist()]
            noise = np.ascontiguousarray(np.stack(samples, axis=-1))
        rows = records[group] if record else np.empty((1, *memory.shape[1:]))
        program(plan).fly(memory[group], parameters[group], noise, rows, slots)

    with ThreadPoolExecutor(threads) as executor:
        for _ in executor.map(fly_group, range(len(memory))):
            pass
    return _flights(batch, memory, records)


def _groups(n, lanes):
    """Return the vehicles of each group; the last one is filled up with the last vehicle."""
    return np.minimum(np.arange(math.ceil(n / lanes) * lanes), n - 1).reshape(-1, lanes)


def _grouped(rows, groups, n):
    """Return rows of shape (n,), or numbers, as one array of shape (groups, rows, lanes)."""
    full = np.array([np.broadcast_to(row, (n,))[groups] for row in rows])
    return np.ascontiguousarray(full.swapaxes(0, 1))


def _flights(batch, memory, records):
    dims = batch.plan.memory_dims()
    at = flight.components(range(sum(dims.values())), dims)

    def vehicles(array, name):
        """Return (groups, ..., rows, lanes) as (..., n, dim)."""
        part = np.moveaxis(array[..., at[name], :], 0, -2)
        joined = part.reshape(*part.shape[:-2], part.shape[-2] * part.shape[-1])
        return joined.swapaxes(-2, -1)[..., : batch.n, :]

    largest, squares, upright, speed = vehicles(memory, "metrics").T
    x = vehicles(memory, "x")
    # NaN of an overflow compares as false.
    has_crashed = (vehicles(memory, "has_crashed")[:, 0] > 0.0) | ~np.isfinite(x).all(axis=1)
    counted = np.maximum(batch.ticks - batch.parameters["settled"][0], 1.0)
    return Flights(
        x=x,
        has_crashed=has_crashed,
        largest_error=largest,
        rms_error=np.sqrt(squares / counted),
        largest_tilt=np.arccos(np.clip(upright, -1.0, 1.0)),
        largest_speed=speed,
        states=vehicles(records, "x"),
        controls=vehicles(records, "u"),
    )
