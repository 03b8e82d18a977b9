"""The parameter server: a node reads its own parameters in one request; a thread sets them."""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any


class PrivateParameters:
    """The parameters below the absolute name of a node, and those to which names are remapped.

    For ``get_param`` and ``resolve`` see `Transport` and `NodeHandle`.
    """

    def __init__(self, get_param: Callable[[str], Any], node: str, resolve: Callable[[str], str]):
        self._get_param = get_param
        self._prefix = node + "/"
        self._resolve = resolve
        try:
            self._own = get_param(node)
        except KeyError:
            self._own = {}

    def full_name(self, name: str) -> str:
        """Return the absolute name of a parameter: of the node, unless it begins with a slash."""
        return self._resolve(name if name.startswith("/") else "~" + name)

    def get(self, name: str) -> Any:
        """Return the raw value of a parameter; KeyError without."""
        full_name = self.full_name(name)
        if not full_name.startswith(self._prefix):
            return self._get_param(full_name)
        value = self._own
        for key in full_name.removeprefix(self._prefix).split("/"):
            if not isinstance(value, dict):
                raise KeyError(name)
            value = value[key]
        return value


class ParameterWriter:
    """Sets parameters in the order in which they changed, each to its latest value.

    A thread calls ``write(name, value)``, which may take any time, and ``report(text)`` on errors.
    """

    def __init__(self, write: Callable[[str, Any], None], report: Callable[[str], None]):
        self._write = write
        self._report = report
        self._lock = threading.Lock()
        self._waiting: dict[str, tuple[Any, Future[None]]] = {}
        self._is_running = False

    def set(self, name: str, value: Any) -> "Future[None]":
        """Set a parameter soon; the future is done when this value, or a later one, is set."""
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
                # The master may have ended, or xmlrpc may not support the value.
                self._report(f"parameter {name} is not set on the parameter server: {error!r}")
                done.set_exception(error)
            else:
                done.set_result(None)
