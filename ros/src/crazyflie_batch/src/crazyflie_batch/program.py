"""Programs that fly a group of vehicles with one plan: machine code, or numpy without llvmlite."""

import logging
import threading
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from crazyflie_batch import flight
from crazyflie_batch.flight import Plan
from crazyflie_model.stabilized_quadrotor import STEPS_PER_SAMPLE

#: Modules in which an unsupported formula raises its error.
_CALCULATES = ("crazyflie_batch.symbols", "crazyflie_model.elementwise", "numpy")


@contextmanager
def naming_the_formula() -> Iterator[None]:
    """Add the name, file and line of the formula to a TypeError."""
    try:
        yield
    except (AttributeError, TypeError, ValueError) as error:
        frames = [
            (frame.f_code, line)
            for frame, line in traceback.walk_tb(error.__traceback__)
            if not frame.f_globals["__name__"].startswith(_CALCULATES)
        ]
        code, line = frames[-1]
        raise TypeError(
            f"the formula {code.co_qualname} ({code.co_filename}, line {line}) cannot be "
            f"computed for many vehicles: {error}"
        ) from error


try:
    from crazyflie_batch.machine_code import MachineCode
except (ImportError, OSError) as error:
    MachineCode = None  # type: ignore[assignment, misc]
    _MISSING = str(error)
else:
    _MISSING = ""

Array = NDArray[np.float64]

_log = logging.getLogger(__name__)


class ArrayProgram:
    """Flies groups of vehicles that have a plan in common by numpy's arrays; thread-safe."""

    lanes = 256  #: Vehicles in a group, the last axis of all arrays.

    def __init__(self, plan: Plan):
        self._plan = plan

    def fly(
        self, memory: Array, parameters: Array, noise_samples: Array, record: Array, slots: int
    ) -> None:
        """Fly a group.

        ``memory``, shape (sum of memory_dims, lanes), is replaced by that at the end. The noise
        samples have the shape (ticks, NOISE_DIM, lanes). ``record``, shape (ticks or 1, sum of
        memory_dims, lanes), is replaced by the memory of every tick, when its controls have been
        given; with one row, by that of the last tick. ``slots`` is the longest delay, in ticks, and
        1.
        """
        plan, dims = self._plan, self._plan.memory_dims()
        values = flight.components(parameters, plan.parameter_dims)
        state = flight.components(memory.copy(), dims)
        delay, lanes = values["delay"][0], np.arange(self.lanes)
        transit = np.zeros((slots, flight.POSE_DIM, self.lanes))
        # States may overflow, and the branch that `where` does not choose may divide by zero.
        with naming_the_formula(), np.errstate(all="ignore"):
            for tick, noise in enumerate(noise_samples):
                state = flight.update_metrics(plan, state, values)
                transit[tick % slots] = flight.measure(plan, state, values, [*noise])
                sent = (tick + slots - delay.astype(int)) % slots
                arrived = [*transit[sent, :, lanes].T]
                state = flight.run_controller(plan, state, values, arrived)
                _store(record[tick % len(record)], state, dims)
                for count in range(plan.steps):
                    state = flight.step(plan, state, values, count % STEPS_PER_SAMPLE)
        _store(memory, state, dims)


def _store(rows, state, dims):
    for row, part in zip(rows, (part for name in dims for part in state[name]), strict=True):
        row[:] = part


_compiling = threading.Lock()


def program(plan: Plan) -> "ArrayProgram | MachineCode":
    """Return the program of a plan, made once in a process for all threads.

    TypeError: a formula cannot be traced; the text names it.
    """
    with _compiling:
        return _program(plan)


@lru_cache(maxsize=16)
def _program(plan):
    if MachineCode is None:
        _warn_of_numpy()
        return ArrayProgram(plan)
    with naming_the_formula():
        return MachineCode(plan)


@lru_cache(maxsize=1)
def _warn_of_numpy():
    _log.warning("llvmlite is missing (%s): flights are computed with numpy, more slowly", _MISSING)


def clear() -> None:
    """Drop all programs; they are compiled again when they are needed."""
    _program.cache_clear()
