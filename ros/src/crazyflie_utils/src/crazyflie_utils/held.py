"""A last good value that does not outlive its source."""

import math

HOLD_LIMIT = 0.5
"""How long, in s, a last good value may stand in for bad ones: the firmware,
too, gives up on a setpoint after 500 ms."""


class Held:
    """The latest good value of an input that may turn bad.

    A good value stays until the next one, unless bad ones come: then it stays
    for at most ``limit`` after the first bad one.

    Parameters
    ----------
    limit : float
        s.
    """

    def __init__(self, limit: float = HOLD_LIMIT):
        self._limit = limit
        self._value = None
        self._expiry = math.inf

    def good(self, value) -> None:
        """Take a good value."""
        self._value = value
        self._expiry = math.inf

    def bad(self, time: float) -> None:
        """Take note that a bad value came at ``time`` (s)."""
        self._expiry = min(self._expiry, time + self._limit)

    def value(self, time: float):
        """Return the value that holds at ``time`` (s); None before the first and after the last."""
        return self._value if time < self._expiry else None
