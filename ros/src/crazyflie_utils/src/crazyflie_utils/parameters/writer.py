"""Parameters are set on the parameter server by a thread that may wait for the master."""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any


class ParameterWriter:
    """Sets parameters in the order in which they changed, each to its latest value.

    A thread calls ``write(name, value)``, however long that takes, and ``report(text)`` when it has
    raised.
    """

    def __init__(self, write: Callable[[str, Any], None], report: Callable[[str], None]):
        self._write = write
        self._report = report
        self._lock = threading.Lock()
        self._waiting: dict[str, tuple[Any, Future[None]]] = {}
        self._is_running = False

    def set(self, name: str, value: Any) -> "Future[None]":
        """Have a parameter set soon; the future is done when this value, or a later one, is set."""
        with self._lock:
            _, done = self._waiting.get(name, (None, Future()))
            self._waiting[name] = value, done
            if self._is_running:
                return done
            self._is_running = True
        threading.Thread(target=self._run, name="parameters", daemon=True).start()
        return done

    def _run(self):
        while True:
            with self._lock:
                if not self._waiting:
                    self._is_running = False
                    return
                name = next(iter(self._waiting))
                value, done = self._waiting.pop(name)
            try:
                self._write(name, value)
            except Exception as error:
                # The master may be gone, or xmlrpc may know no such value.
                self._report(f"parameter {name} is not set on the parameter server: {error!r}")
                done.set_exception(error)
            else:
                done.set_result(None)
