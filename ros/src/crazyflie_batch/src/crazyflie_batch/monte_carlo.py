"""Flights with parameters drawn at random, in chunks whose outcomes are kept on disk."""

import dataclasses
import json
import os
from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path
from queue import Empty, Queue
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crazyflie_batch import simulation
from crazyflie_batch.code_version import OtherFlightsError, code_version
from crazyflie_batch.estimators import FiniteDifferences, Kalman
from crazyflie_batch.settings import Settings

CHUNK_SIZE = 256  #: Flights in a chunk: some tenths of a second on one processor.
#: Longest time without a finished chunk, s: workers of a cluster may be slow, or gone.
CHUNK_TIMEOUT = 600.0
#: Columns of results; see `crazyflie_batch.Flights`.
OUTCOMES = ("largest_error", "rms_error", "largest_tilt", "largest_speed", "has_crashed")


class Results:
    """A folder with the outcomes of flights, from which an interrupted run continues.

    It also has the settings and the `code_version` of the flights, and is created if missing.
    `OtherFlightsError`: they are of other settings, or of another version of the code.
    """

    def __init__(self, folder: Path, settings: Settings):
        self.folder = folder
        self._chunks = folder / "chunks"
        self._flights = settings.run.flights
        self._chunks.mkdir(parents=True, exist_ok=True)
        present = {**dataclasses.asdict(settings), "code": code_version()}
        text = json.dumps(present, indent=1, sort_keys=True)
        noted = folder / "settings.json"
        if noted.exists():
            _check(folder, json.loads(text), noted.read_bytes())
        noted.write_text(text, encoding="utf-8")

    def missing(self) -> list[int]:
        """Return the numbers of the first flights of missing chunks."""
        firsts = range(0, self._flights, CHUNK_SIZE)
        return [first for first in firsts if not self._path(first).exists()]

    def flown(self) -> int:
        """Return the number of flights that have outcomes."""
        return self._flights - sum(
            min(CHUNK_SIZE, self._flights - first) for first in self.missing()
        )

    def keep(self, first: int, outcomes: NDArray[np.float64]) -> None:
        """Write the outcomes of a chunk, shape (flights, len(OUTCOMES))."""
        unfinished = self._chunks / "unfinished.npy"
        np.save(unfinished, outcomes)
        os.replace(unfinished, self._path(first))

    def outcomes(self) -> NDArray[np.float64]:
        """Return the outcomes of all flights, shape (flights, len(OUTCOMES))."""
        return np.concatenate([self._load(i) for i in range(0, self._flights, CHUNK_SIZE)])

    def _load(self, first):
        path = self._path(first)
        try:
            return np.load(path)
        except (ValueError, EOFError):
            path.unlink()
            raise OSError(f"{path} was damaged, and is gone; call again to fly it again") from None

    def _path(self, first):
        return self._chunks / f"{first:08d}.npy"


def _check(folder, present, text):
    try:
        noted = json.loads(text)
    except ValueError:
        noted = None
    if noted != present:
        is_same = isinstance(noted, dict) and {**noted, "code": present["code"]} == present
        other = "another version of the code" if is_same else "other settings"
        raise OtherFlightsError(
            f"{folder} has flights of {other}; expected another --out, or --restart"
        )


def run(
    settings: Settings, results: Results, executor: Executor, report: Callable[[int], object]
) -> None:
    """Simulate the missing chunks; call ``report(count)`` with the flights of each when it ends.

    TimeoutError: no chunk was finished for `CHUNK_TIMEOUT`.
    """
    values = settings.values()
    futures: dict[Any, int] = {}
    done: Queue[Any] = Queue()
    for first in results.missing():
        own = {name: part[first : first + CHUNK_SIZE] for name, part in values.items()}
        future = executor.submit(fly_chunk, settings, first, own, code_version())
        futures[future] = first
        future.add_done_callback(done.put)
    try:
        for _ in range(len(futures)):
            future = done.get(timeout=CHUNK_TIMEOUT)
            outcomes = future.result()
            results.keep(futures[future], outcomes)
            report(len(outcomes))
    except Empty:
        raise TimeoutError(f"no flight has ended for {CHUNK_TIMEOUT:g} s") from None
    finally:
        for future in futures:
            future.cancel()


def fly_chunk(
    settings: Settings, first: int, values: dict[str, NDArray[np.float64]], code: str
) -> NDArray[np.float64]:
    """Return the outcomes of a chunk, shape (flights, len(OUTCOMES)).

    ``values`` are the swept parameters of the flights from number ``first`` on, see
    `Settings.values`; ``code`` is the `code_version` of the other flights, or else
    `OtherFlightsError`.
    """
    if code != code_version():
        raise OtherFlightsError("a worker has another version of the code")
    flights = simulate(settings, first, values)
    return np.column_stack([getattr(flights, name) for name in OUTCOMES]).astype(float)


def simulate(
    settings: Settings, first: int, values: dict[str, NDArray[np.float64]]
) -> simulation.Flights:
    """Return the flights of a chunk; see `fly_chunk`."""
    run, n = settings.run, len(next(iter(values.values())))
    swept: dict[str, Any] = dict(values)
    vehicle = dataclasses.replace(settings.vehicle, **swept)
    is_kalman = run.estimator == "kalman"
    return simulation.simulate(
        _model(settings, vehicle, n),
        _controller(settings, vehicle, n),
        Kalman(run.filter_noise, run.filter_walk) if is_kalman else FiniteDifferences(),
        (run.start_x, run.start_y, run.start_z),
        n,
        goal=(run.goal_x, run.goal_y, run.goal_z, 0.0, 0.0, 0.0, run.goal_yaw),
        duration=run.duration,
        period=run.period,
        settle_time=run.settle_time,
        measurement=simulation.Measurement(
            vehicle.position_noise, vehicle.attitude_noise, vehicle.delay, vehicle.dropout
        ),
        seed=run.seed,
        first=first,
        threads=1,
    )


def _model(settings, vehicle, n):
    if settings.run.model != "quadrotor":
        return getattr(simulation, settings.run.model)()
    wind = [np.broadcast_to(part, n) for part in (vehicle.wind_x, vehicle.wind_y, vehicle.wind_z)]
    return simulation.quadrotor(vehicle.mass_error, vehicle.thrust_error, np.stack(wind, axis=-1))


def _controller(settings, vehicle, n):
    run = settings.run
    factors = [vehicle.position_gain] * 2 + [vehicle.height_gain]
    factors += [vehicle.velocity_gain] * 2 + [vehicle.climb_gain, vehicle.yaw_gain]
    columns = np.stack([np.broadcast_to(factor, n) for factor in factors], axis=-1)
    integrator = np.broadcast_to(vehicle.integrator_gain, n)[:, np.newaxis]
    return simulation.Controller(
        np.array(settings.K) * columns[:, np.newaxis, :],
        integrator_k=integrator * (run.integrator_k_x, run.integrator_k_y, run.integrator_k_z),
        integrator_limit=(run.integrator_x, run.integrator_y, run.integrator_z),
    )
