"""The command certify: many flights that try to leave the fence of a vehicle."""

import argparse
import os
import runpy
import sys
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from rospkg import RosPack
from tqdm import tqdm
from typing_extensions import override

from crazyflie_batch.fence_flights import POLICY_SIZE, Array, Case, Controller, fly, rounded
from crazyflie_geofence import bounds
from crazyflie_geofence.bounds import Bounds
from crazyflie_geofence.viable_set import Axis
from crazyflie_utils import ParameterError, Parameters, parameter
from crazyflie_utils.parameters import yaml_file
from crazyflie_utils.parameters.types import TEXT, Integer, Number
from crazyflie_utils.parameters.vehicle_model import VEHICLE_MODEL
from crazyflie_utils.text_file import user_path

CHUNK_SIZE = 2000  #: Flights with the same bounds and walls.
GENERATIONS, ELITE = 25, 0.1  #: Of a search, and the share of adversaries that continue.
EXCESS = 1.5  #: The true disturbance over its bound, where flights must leave.
_DESCRIPTION = "Fly a vehicle many times against its fence; print how many flights left the box."


class CertifyParameters(Parameters):
    """Settings of a run."""

    model: str = parameter(VEHICLE_MODEL, "type of the vehicle, or model file with its bounds")
    flights: int = parameter(Integer(1, 100_000_000), "how many, along x or z", 100_000)
    seed: int = parameter(Integer(0, 2**32 - 1), "seed of all random numbers", 0)
    duration: float = parameter(Number("s", minimum=0.1, maximum=60.0), "of a flight", 3.0)
    horizontal_braking: float = parameter(
        Number("m/s^2", minimum=0.01), "as in the geofence", 1.4, "braking/horizontal"
    )
    vertical_braking: float = parameter(
        Number("m/s^2", minimum=0.01), "as in the geofence", 2.0, "braking/vertical"
    )
    vary: float = parameter(
        Number(minimum=1.0, maximum=4.0),
        "other vehicles too: each bound is multiplied by a factor up to this, or divided",
        1.0,
    )
    controller: str = parameter(
        TEXT,
        "FILE.py:FUNCTION(t, p, v, a, walls), the regular controller, next to this file; by "
        "default controllers that press, bounce, dither, and are searched for",
        "",
    )

    @override
    def complaints(self) -> Iterator[str]:
        try:
            axes = self.axes
        except ParameterError as error:
            yield from error.complaints
            return
        for name, axis in zip(("horizontal", "vertical"), axes, strict=True):
            if axis.disturbance >= axis.braking:
                yield (
                    f"braking/{name} is {axis.braking:g}; expected more than the disturbance, "
                    f"{axis.disturbance:g} m/s^2"
                )

    @cached_property
    def axes(self) -> tuple[Axis, Axis]:
        """Bounds along x and z; `ParameterError` if the model does not have all of them."""
        known = bounds.complete(Bounds(), self.model)
        braking = self.horizontal_braking, self.vertical_braking
        x, _, z = bounds.axes(known, *braking)
        return x, z


@dataclass(frozen=True)
class Chunk:
    """Flights with the same bounds, and different adversaries."""

    case: Case
    policy: Array  #: Shape (POLICY_SIZE, flights).
    seed: int
    controller: tuple[str, str] | None  #: File and function of a regular controller.


def drawn(settings: CertifyParameters, seed: int, flights: int, excess: float) -> Chunk:
    """Return a chunk with walls, bounds and adversaries drawn at random."""
    random = np.random.default_rng((settings.seed, seed))
    axis = settings.axes[seed % 2]
    names = ("tau", "disturbance", "position_error", "velocity_error", "delay", "period")
    factors = settings.vary ** random.uniform(-1.0, 1.0, len(names))
    changed = {n: getattr(axis, n) * float(f) for n, f in zip(names, factors, strict=True)}
    changed["disturbance"] = min(changed["disturbance"], 0.8 * axis.braking)
    axis = rounded(replace(axis, **changed))
    width = axis.smallest_box + float(random.exponential())
    case = Case(axis, 0.0, width, round(settings.duration / axis.period), excess)
    policy = random.standard_normal((POLICY_SIZE, flights))
    # Most adversaries mind few things: one that looks at all of them does not press.
    policy *= random.random(policy.shape) < random.random(flights)
    file, _, function = settings.controller.rpartition(":")
    own = int(random.integers(2**32))
    return Chunk(case, policy, own, (file, function) if function else None)


def outside(chunk: Chunk) -> Array:
    """Return how far each flight of a chunk was outside, m."""
    own = None if chunk.controller is None else load_controller(*chunk.controller)
    return fly(chunk.case, chunk.policy, chunk.seed, own)


def searched(chunk: Chunk) -> Array:
    """Return how far the flights of a search were outside, m; each generation learns from the last.

    Cross-entropy method (Rubinstein, 1999): the next adversaries are drawn around the best.
    """
    random = np.random.default_rng(chunk.seed)
    farthest = []
    for _ in range(GENERATIONS):
        farthest.append(outside(chunk))
        best = np.argsort(-farthest[-1])[: max(2, int(ELITE * len(farthest[-1])))]
        mean = chunk.policy[:, best].mean(axis=1, keepdims=True)
        spread = chunk.policy[:, best].std(axis=1, keepdims=True) + 0.05
        policy = mean + spread * random.standard_normal(chunk.policy.shape)
        chunk = replace(chunk, policy=policy, seed=chunk.seed + 1)
    return np.concatenate(farthest)


def load_controller(file: str, function: str) -> Controller:
    """Return a function of a Python file; `ParameterError` if there is none."""
    path = user_path(file)
    expected = "FILE.py:FUNCTION(t, p, v, a, walls), which returns an acceleration for each vehicle"
    if not path.is_file():
        raise ParameterError(f"controller is {file}:{function}: no such file; expected {expected}")
    try:
        found = runpy.run_path(str(path))[function]
        answer = np.asarray(found(0.0, *np.zeros((3, 2)), (0.0, 1.0)), dtype=float)
    except Exception as error:
        raise ParameterError(
            f"controller is {file}:{function}: {error!r}; expected {expected}"
        ) from error
    if answer.shape not in ((), (2,)) or not np.isfinite(answer).all():
        raise ParameterError(
            f"controller is {file}:{function}: it returned {answer}; expected {expected}"
        )
    return found


@dataclass(frozen=True)
class Row:
    """Flights of one kind."""

    name: str
    flights: int
    left: int  #: Flights that were outside.
    farthest: float  #: Largest distance outside, m.

    def text(self) -> str:
        """Return a line; the rate is the upper bound of its interval of 95 %, for a count of 0."""
        rate = f"{self.left / self.flights:.2%}"
        if not self.left:
            rate = f"below {1.0 - 0.05 ** (1.0 / self.flights):.2g}"
        return (
            f"{self.name:34}{self.flights:>10}{self.left:>10}  {rate:16}{1e3 * self.farthest:8.2f}"
        )


def run(settings: CertifyParameters, executor: Executor) -> list[Row]:
    """Fly; return within the bounds, with searched adversaries, and beyond the bounds."""
    chunks = -(-settings.flights // CHUNK_SIZE)
    sizes = [CHUNK_SIZE] * (chunks - 1) + [settings.flights - CHUNK_SIZE * (chunks - 1)]
    within = [drawn(settings, k, size, 1.0) for k, size in enumerate(sizes)]
    searches = [
        drawn(settings, 10**6 + k, CHUNK_SIZE // 4, 1.0) for k in range(max(2, chunks // 50))
    ]
    beyond = [drawn(settings, 2 * 10**6 + k, CHUNK_SIZE, EXCESS) for k in range(2)]
    rows = []
    for name, function, work in (
        ("within the bounds", outside, within),
        ("adversaries that were searched for", searched, searches),
        (f"disturbance {EXCESS:g} times its bound", outside, beyond),
    ):
        results = tqdm(executor.map(function, work), name, len(work), unit="chunk")
        farthest = np.concatenate(list(results))
        rows.append(Row(name, len(farthest), int((farthest > 0.0).sum()), float(farthest.max())))
    return rows


def table(settings: CertifyParameters, rows: list[Row]) -> str:
    """Return the table of a run."""
    lines = [f"fence of {settings.model}, flights of {settings.duration:g} s", ""]
    for name, axis in zip("xz", settings.axes, strict=True):
        lines.append(
            f"{name}: lag {axis.tau:g} s, delay {axis.delay:g} s, braking {axis.braking:g} and "
            f"disturbance {axis.disturbance:g} m/s^2,\n   errors {axis.position_error:g} m and "
            f"{axis.velocity_error:g} m/s; box at least {axis.smallest_box:.2f} m"
        )
    head = f"\n{'':34}{'flights':>10}{'left':>10}  {'rate (95 %)':16}{'farthest, mm':>8}"
    return "\n".join([*lines, head, *(row.text() for row in rows)])


def read_settings(path: str) -> CertifyParameters:
    """Return the settings in a file; `ParameterError` names all errors with file and line."""
    settings = yaml_file.load(path).read(CertifyParameters)
    file, _, function = settings.controller.rpartition(":")
    if not settings.controller:
        return settings
    local = Path(path).parent / user_path(file)
    load_controller(str(local), function)
    return replace(settings, controller=f"{local}:{function}")


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0 if no flight within the bounds left, 1 otherwise or for errors."""
    parser = argparse.ArgumentParser(prog="certify", description=_DESCRIPTION)
    shipped = Path(RosPack().get_path("crazyflie_batch"), "config", "certify.yaml")
    parser.add_argument(
        "settings", nargs="?", default=str(shipped), metavar="SETTINGS.yaml", help="(%(default)s)"
    )
    try:
        settings = read_settings(parser.parse_args(arguments).settings)
        with ProcessPoolExecutor(len(os.sched_getaffinity(0))) as executor:
            rows = run(settings, executor)
    except (ParameterError, OSError) as error:
        print(f"certify: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("certify: interrupted", file=sys.stderr)
        return 130
    print(table(settings, rows))
    return int(any(row.left for row in rows[:2]))
