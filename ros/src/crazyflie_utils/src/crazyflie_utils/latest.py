"""Subscriptions of which only the latest message counts."""

from collections.abc import Callable
from typing import Any


class Latest:
    """The latest message of a topic that has not been delivered.

    Parameters
    ----------
    callback : callable
        ``callback(message)``
    """

    def __init__(self, callback: Callable[[Any], None]):
        self._callback = callback
        self._message: Any = None

    def take(self, message: Any) -> None:
        """Keep a message in the place of the one before."""
        self._message = message

    def deliver(self) -> None:
        """Call back with the latest message, if it is new."""
        message, self._message = self._message, None
        if message is not None:
            self._callback(message)
