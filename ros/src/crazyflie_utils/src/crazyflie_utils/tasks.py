"""Work that waits for something outside, such as a vehicle, in turn with all callbacks."""

import itertools
import threading
from collections.abc import Callable
from typing import Any, TypeVar

from crazyflie_utils.timers import Executor

Result = TypeVar("Result")


class Tasks:
    """Threads that have the executor's turn, as a callback has it, except within `outside`.

    So one of them runs at a time, together with all callbacks, and none needs a lock. A journal has
    the order in which they go on.
    """

    def __init__(self, executor: Executor):
        #: Called in the turn with the number of a task that begins, or goes on.
        self.on_turn: Callable[[int], None] = lambda number: None
        self._executor = executor
        self._numbers = itertools.count(1)
        # The number of the thread's task, while it has its turn.
        self._own = threading.local()

    def start(self, name: str, work: Callable[[], None]) -> None:
        """Begin a task after the running callback; ``work()`` must not raise."""
        number = next(self._numbers)
        thread = threading.Thread(target=self._run, args=(number, work), name=name, daemon=True)
        self._executor.submit(thread.start)

    def outside(self, call: Callable[..., Result], *arguments: Any) -> Result:
        """Return ``call(*arguments)``, which may wait; a task gives up its turn meanwhile.

        In a replay it is not called, and the result is None.
        """
        number = getattr(self._own, "number", None)
        if number is None:
            return call(*arguments)
        self._end_turn()
        try:
            return call(*arguments)
        finally:
            self._take_turn(number)

    def _run(self, number, work):
        self._take_turn(number)
        try:
            work()
        finally:
            self._end_turn()

    def _take_turn(self, number):
        self._executor.take_turn()
        self.on_turn(number)
        self._own.number = number

    def _end_turn(self):
        # What follows is not part of the task.
        self._own.number = None
        self._executor.end_turn()
