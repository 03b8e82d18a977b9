"""What every part of a node's handle stands on: its name, its log, and its faults."""

import time
from collections.abc import Callable, Hashable
from typing import TYPE_CHECKING, Any

from crazyflie_utils.faults import Faults
from crazyflie_utils.throttle import Throttle

if TYPE_CHECKING:
    from crazyflie_utils.process import Process


class HandleBase:
    """Name, log and faults of a node.

    Parameters
    ----------
    process : Process
        What the nodes of a process share.
    name : str
        Absolute name of the node, such as /simulator.
    """

    def __init__(self, process: "Process", name: str):
        self._process = process
        self._name = name
        self._faults = Faults(self)
        self._throttle = Throttle()
        self._undo: list[Callable[[], None]] = []
        self._to_deliver: list[Callable[[], None]] = []
        self._is_closed = False

    @property
    def name(self) -> str:
        """Absolute name of the node."""
        return self._name

    @property
    def is_closed(self) -> bool:
        """Whether `close` has been called."""
        return self._is_closed

    def end(self, status: int = 0) -> None:
        """End the process, and with it all its nodes, with an exit status."""
        self._process.end(status)

    def info(self, text: str) -> None:
        """Log what an operator may want to know."""
        self._process.transport.log("info", f"{self._name}: {text}")

    def warn(self, text: str, throttle: float = 0.0, key: Hashable = None) -> None:
        """Log a warning; the same ``key`` (the text) at most once in ``throttle`` seconds.

        The seconds are those of the machine's clock, so that a simulation that
        runs fast does not flood the screen. A text that varies needs a key.
        """
        key = text if key is None else key
        if throttle > 0.0 and not self._throttle.passes(key, throttle, time.monotonic()):
            return
        self._process.transport.log("warn", f"{self._name}: {text}")

    def error(self, text: str) -> None:
        """Log what makes the node fail."""
        self._process.transport.log("error", f"{self._name}: {text}")

    def report_fault(self, callback: Callable[..., Any], error: Exception) -> None:
        """Log that a callback of this node has raised, and have the node made safe."""
        self._faults.report(callback, error)

    def on_fault(self, make_safe: Callable[[], None]) -> None:
        """Have ``make_safe()`` called after a callback of this node has raised."""
        self._faults.make_safe = make_safe

    def guard(self, callback: Callable[..., Any]) -> Callable[..., None]:
        """Return ``callback`` such that what it raises is reported and goes no further."""

        def guarded(*args):
            if self._is_closed:
                return
            try:
                callback(*args)
            except Exception as error:
                self.report_fault(callback, error)

        return guarded
