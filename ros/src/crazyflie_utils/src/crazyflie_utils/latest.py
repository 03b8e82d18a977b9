"""Subscriptions of which only the latest message counts."""

from collections.abc import Callable
from functools import partial
from typing import Any

from crazyflie_utils.topics import Subscriber


class Latest:
    """The latest message of a topic, until somebody wants it delivered.

    Parameters
    ----------
    callback : callable
        ``callback(message)``
    """

    def __init__(self, callback: Callable[[Any], None]):
        self._callback = callback
        self._message: Any = None
        self._collect: Callable[[], None] | None = None

    def begin(
        self, subscriber: Subscriber, submit: Callable[[Callable[[], None]], None], is_lazy: bool
    ) -> None:
        """Let messages of other processes wait in their sockets, if ``is_lazy``.

        Parameters
        ----------
        subscriber : Subscriber
            Whose messages `take` receives.
        submit : callable
            Of the executor, which runs everything else here, too.
        is_lazy : bool
        """
        if is_lazy:
            subscriber.read_lazily(True, partial(submit, partial(self._remind, subscriber)))

    def take(self, message: Any) -> None:
        """Keep a message in the place of the one before."""
        self._message = message

    def deliver(self) -> None:
        """Call back for the latest message, if it is new."""
        if self._collect is not None:
            self._collect()
        message, self._message = self._message, None
        if message is not None:
            self._callback(message)

    def _remind(self, subscriber):
        # Who has never heard of another process need not look whether one has said anything.
        self._collect = subscriber.collect
        self.deliver()
