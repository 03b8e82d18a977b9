"""Waiting for a condition, with a limit; without ROS."""

import time
from collections.abc import Callable

LIMIT = 60.0  #: Timeout of a wait (s).


def wait_until(
    condition: Callable[[], object],
    what: str = "a condition",
    limit: float = LIMIT,
    period: float = 0.01,
) -> None:
    """Wait until ``condition()``, checked every ``period`` (s); fail after ``limit`` (s)."""
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end, f"waited {limit:g} s for {what}"
        time.sleep(period)
