"""Callbacks of the node for events of a link, whose threads are not blocked."""

import queue
import threading
from collections.abc import Callable
from functools import partial
from typing import Any

from crazyflie_utils import NodeHandle

#: Data that may be queued; more are dropped. A vehicle logs some 300 packets a second.
MAX_WAITING = 1000


class Delivery:
    """A thread that has callbacks called in their turn with all others of the node.

    `NodeHandle.submit` returns when a callback has run, which takes as long as all callbacks before
    it. A link whose thread blocks on that hears neither its vehicle nor replies.
    """

    def __init__(self, handle: NodeHandle, name: str):
        self._handle = handle
        self._queue: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._is_closed = False
        threading.Thread(target=self._run, name=f"{name}-delivery", daemon=True).start()

    def submit(self, callback: Callable[..., None], *arguments: Any) -> None:
        """Have ``callback(*arguments)`` called in its turn; does not block."""
        self._queue.put(partial(callback, *arguments))

    def submit_data(self, callback: Callable[..., None], *arguments: Any) -> None:
        """Do the same with what may be dropped when too much is queued."""
        if self._queue.qsize() < MAX_WAITING:
            self.submit(callback, *arguments)

    def close(self) -> None:
        """Have nothing called any more."""
        self._is_closed = True
        self._queue.put(lambda: None)

    def _run(self):
        while True:
            callback = self._queue.get()
            if self._is_closed:
                return
            self._handle.submit(callback)
