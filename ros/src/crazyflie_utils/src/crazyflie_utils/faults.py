"""What happens when a callback raises."""

import traceback
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from crazyflie_utils.handle_base import HandleBase


class Faults:
    """Logs what the callbacks of a node raise, and has the node made safe.

    A fault is logged with its traceback when it is new, and later only counted.

    Parameters
    ----------
    log : HandleBase
        Its ``error`` and ``warn`` are used.
    """

    def __init__(self, log: "HandleBase"):
        self.make_safe: Callable[[], None] | None = None
        self._log = log
        self._counts: dict[tuple[type, str, int | None], int] = {}

    def report(self, callback: Callable[..., Any], error: Exception) -> None:
        """Log that ``callback`` has raised ``error``, and make the node safe."""
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
        if self.make_safe is None:
            return
        try:
            self.make_safe()
        except Exception as second:
            self._log.error(f"make_safe failed too: {second!r}")
