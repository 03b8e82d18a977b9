"""A node's log: repeated texts are limited, and each fault has one traceback."""

import time
import traceback
from collections.abc import Callable, Hashable
from typing import Any

from crazyflie_utils.topics import Transport

_MAX_KEYS = 64


class Throttle:
    """Passes each key once in a period; new keys do not pass while `_MAX_KEYS` are stored."""

    def __init__(self) -> None:
        self._allowed_from: dict[Hashable, float] = {}

    def passes(self, key: Hashable, period: float, now: float) -> bool:
        """Return whether ``key`` may pass at ``now`` (s); if so, not again for ``period`` (s)."""
        if now < self._allowed_from.get(key, now):
            return False
        if key not in self._allowed_from and len(self._allowed_from) >= _MAX_KEYS:
            self._allowed_from = {k: end for k, end in self._allowed_from.items() if now < end}
            if len(self._allowed_from) >= _MAX_KEYS:
                return False
        self._allowed_from[key] = now + period
        return True


class NodeLog:
    """Log of one node, whose absolute name begins each text."""

    def __init__(self, transport: Transport, node: str):
        self._transport = transport
        self._node = node
        self._throttle = Throttle()

    def info(self, text: str) -> None:
        """Log information for an operator."""
        self._transport.log("info", f"{self._node}: {text}")

    def warn(self, text: str, throttle: float = 0.0, key: Hashable = None) -> None:
        """Log a warning; the same ``key`` (the text) at most once in ``throttle`` seconds.

        The time is that of the machine's clock, also in simulated time. A varying text needs a key.
        """
        key = text if key is None else key
        if throttle <= 0.0 or self._throttle.passes(key, throttle, time.monotonic()):
            self._transport.log("warn", f"{self._node}: {text}")

    def error(self, text: str) -> None:
        """Log an error that makes the node fail."""
        self._transport.log("error", f"{self._node}: {text}")


class FaultHandler:
    """Logs exceptions of a node's callbacks, and calls its `enter_safe_state`.

    A new fault is logged with its traceback; repetitions are only counted.
    """

    def __init__(self, log: NodeLog):
        self.enter_safe_state: Callable[[], None] | None = None  #: Called after each fault.
        self._log = log
        self._counts: dict[tuple[type, str, int | None], int] = {}

    def report(self, callback: Callable[..., Any], error: Exception) -> None:
        """Log that ``callback`` has raised ``error``, and put the node into its safe state."""
        where = traceback.extract_tb(error.__traceback__)[-1]
        fault = (type(error), where.filename, where.lineno)
        count = self._counts[fault] = self._counts.get(fault, 0) + 1
        name = getattr(callback, "__qualname__", repr(callback))
        if count == 1:
            self._log.error(f"{name} failed\n{''.join(traceback.format_exception(error))}")
        else:
            self._log.warn(
                f"{name} failed again: {error!r} ({count} times)", throttle=5.0, key=fault
            )
        if self.enter_safe_state is None:
            return
        try:
            self.enter_safe_state()
        except Exception as second:
            self._log.error(f"enter_safe_state failed too: {second!r}")
