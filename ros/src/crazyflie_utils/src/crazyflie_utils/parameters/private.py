"""A node's own parameters on the parameter server, read in one request."""

from collections.abc import Callable
from typing import Any


class PrivateParameters:
    """The parameters below the absolute name of a node, and those of others that are remapped to.

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
