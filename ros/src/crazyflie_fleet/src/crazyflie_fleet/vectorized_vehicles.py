"""Many simulated vehicles of one model, all of them advanced by the same numpy operations."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from crazyflie_model.dynamics import LEVEL_STEPS, STEP, SevenDimensional, watchdog_control

_NEVER = np.iinfo(np.int64).max


class VectorizedVehicles:
    """Vehicles that each fly like a `crazyflie_simulator.vehicle.SimulatedVehicle`, on one clock.

    ``positions``, shape (n, 3), m, fixed frame, and ``time``, s, are those of the beginning.
    """

    def __init__(self, dynamics: SevenDimensional, positions: ArrayLike, time: float):
        columns = np.array(positions, dtype=float).T
        self._dynamics = dynamics
        self._n = columns.shape[1]
        # All components are arrays, also those that are equal for all vehicles at the beginning.
        self._x = [
            np.array(np.broadcast_to(c, self._n)) for c in dynamics.initial_state(list(columns))
        ]
        self._u = np.zeros((4, self._n))
        self._since = np.full(self._n, _NEVER)
        # Number of a vehicle to the step from which its next control holds, and this control.
        self._next: dict[int, tuple[int, Sequence[float]]] = {}
        self._start = time
        self._steps = 0

    @property
    def time(self) -> float:
        """Time of the states, s: a whole number of steps after the beginning."""
        return self._start + self._steps * STEP

    @property
    def states(self) -> NDArray[np.float64]:
        """States, shape (n, 7)."""
        return np.stack(self._x, axis=1)

    @property
    def tilts(self) -> NDArray[np.float64]:
        """Roll and pitch, rad, shape (n, 2)."""
        return np.stack(self._effective_control()[:2], axis=1)

    def command(self, vehicle: int, u: Sequence[float], time: float) -> None:
        """Set the control (4 numbers) of one vehicle from ``time`` (s) on.

        If several come between two calls of `advance_to`, the last one is used.
        """
        self._next[vehicle] = (max(math.floor((time - self._start) / STEP + 1e-6), 0), u)

    def skip(self, duration: float) -> None:
        """Advance the time by ``duration`` (s) without motion."""
        self._start += duration

    def advance_to(self, time: float) -> None:
        """Integrate to the last whole step before ``time`` (s).

        A ``time`` in the past is a reset of the clock: the vehicles continue from there.
        """
        steps = math.floor((time - self.time) / STEP + 1e-6)
        if steps < -1:
            self._start, self._steps = time, 0
            self._since[self._since != _NEVER] = 0
            self._next = {vehicle: (0, u) for vehicle, (_, u) in self._next.items()}
        end = self._steps + steps
        while self._steps < end:
            self._take_commands()
            self._move(min(self._constant_steps(), end - self._steps))
        self._take_commands()

    def _constant_steps(self):
        """Return a number of steps in which all controls are certainly constant."""
        first = [step for step, _ in self._next.values()]
        next_change = min([int(self._since.min()) + LEVEL_STEPS, *first])
        return max(next_change - self._steps, 1)

    def _take_commands(self):
        due = {vehicle: u for vehicle, (step, u) in self._next.items() if step <= self._steps}
        if not due:
            return
        numbers = [*due]
        self._u[:, numbers] = np.array([*due.values()]).T
        self._since[numbers] = self._steps
        self._next = {key: each for key, each in self._next.items() if key not in due}

    def _move(self, steps):
        moved = self._dynamics.steps(steps, self._steps, self._x, self._effective_control())
        obeys = self._since != _NEVER
        # A vehicle stays put until its first control.
        self._x = (
            moved if obeys.all() else [*map(lambda a, b: np.where(obeys, a, b), moved, self._x)]
        )
        self._steps += steps

    def _effective_control(self):
        # `_NEVER` gives an age far below zero: that of a valid control.
        return watchdog_control([*self._u], self._steps - self._since)
