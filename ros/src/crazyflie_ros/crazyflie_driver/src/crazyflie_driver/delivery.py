"""From the threads of a link to the callbacks of the node, without having the link wait."""

import threading
from collections import deque
from collections.abc import Callable
from typing import Any

from crazyflie_utils import NodeHandle

MAX_WAITING = 1000
"""Data that wait for their turn; more are dropped. A vehicle logs some 300 packets a second."""


class Delivery:
    """A thread that has callbacks called in their turn with all others of the node.

    `NodeHandle.submit` returns when a callback has run, which takes as long as all callbacks
    before it. A link whose thread waits for that hears neither its vehicle nor replies.

    Parameters
    ----------
    handle : NodeHandle
    name : str
        For the thread.
    """

    def __init__(self, handle: NodeHandle, name: str):
        self._handle = handle
        self._waiting: deque[tuple[Callable[..., None], tuple[Any, ...]]] = deque()
        self._wake = threading.Condition()
        self._is_closed = False
        threading.Thread(target=self._run, name=f"{name}-delivery", daemon=True).start()

    def submit(self, callback: Callable[..., None], *arguments: Any) -> None:
        """Have ``callback(*arguments)`` called in its turn; does not block."""
        with self._wake:
            self._waiting.append((callback, arguments))
            self._wake.notify()

    def submit_data(self, callback: Callable[..., None], *arguments: Any) -> None:
        """Do the same with what may be dropped when too much waits."""
        if len(self._waiting) < MAX_WAITING:
            self.submit(callback, *arguments)

    def close(self) -> None:
        """Have nothing called any more."""
        with self._wake:
            self._is_closed = True
            self._wake.notify()

    def _run(self):
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._waiting or self._is_closed)
                if self._is_closed:
                    return
                callback, arguments = self._waiting.popleft()
            self._handle.submit(callback, *arguments)
