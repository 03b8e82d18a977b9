"""The last valid value of an input, while its source is alive."""

import math
from typing import Generic, TypeVar

T = TypeVar("T")

#: Longest time for which a valid value replaces invalid ones (s): the firmware, too, gives up a
#: setpoint after 500 ms.
HOLD_LIMIT = 0.5


class LastValid(Generic[T]):
    """The latest valid value of an input; it holds at most ``limit`` (s) after an invalid one."""

    def __init__(self, limit: float = HOLD_LIMIT):
        self._limit = limit
        self._value: T | None = None
        self._expiry = math.inf

    def update(self, value: T) -> None:
        """Set a valid value."""
        self._value = value
        self._expiry = math.inf

    def invalidate(self, time: float) -> None:
        """Record that an invalid value came at ``time`` (s)."""
        self._expiry = min(self._expiry, time + self._limit)

    def value(self, time: float) -> T | None:
        """Return the value at ``time`` (s); None before the first one and after `limit`."""
        return self._value if time < self._expiry else None
