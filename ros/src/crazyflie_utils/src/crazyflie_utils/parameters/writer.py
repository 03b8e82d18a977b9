"""Parameters are set on the parameter server by a thread that may wait for the master."""

import threading
from collections.abc import Callable
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
        self._waiting: dict[str, Any] = {}
        self._is_running = False

    def set(self, name: str, value: Any) -> None:
        """Have a parameter set soon."""
        with self._lock:
            self._waiting[name] = value
            if self._is_running:
                return
            self._is_running = True
        threading.Thread(target=self._run, name="parameters", daemon=True).start()

    def _run(self):
        while True:
            with self._lock:
                if not self._waiting:
                    self._is_running = False
                    return
                name = next(iter(self._waiting))
                value = self._waiting.pop(name)
            try:
                self._write(name, value)
            except Exception as error:
                # The master may be gone, or xmlrpc may know no such value.
                self._report(f"parameter {name} is not set on the parameter server: {error!r}")
