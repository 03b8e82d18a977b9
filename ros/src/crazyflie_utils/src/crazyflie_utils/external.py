"""Objects outside the nodes, such as a vehicle: what comes back from them is in a journal."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from crazyflie_utils.handle import NodeHandle


@dataclass(frozen=True)
class Interface:
    """What an object has beside methods that return JSON at once; names are "part.method"."""

    parts: frozenset[str] = frozenset()  #: Attributes that are such objects.
    reads: frozenset[str] = frozenset()  #: Attributes that are values.
    waits: frozenset[str] = frozenset()  #: Methods that wait.
    #: Methods that return another form of their object, and what its methods' names begin with in
    #: place of the object's; None: they are the same.
    views: Mapping[str, str | None] = field(default_factory=dict)
    #: Functions that return values which are not plain again.
    decode: Mapping[str, Callable[[Any], Any]] = field(default_factory=dict)
    errors: Mapping[str, type[Exception]] = field(default_factory=dict)  #: Own errors, by name.


class External:
    """Passes everything on to an object, by `ProcessContext.value`; it does not exist in a replay.

    In turn, each outcome is in the journal, with numbers and texts of the call's arguments.
    """

    def __init__(
        self, handle: NodeHandle, interface: Interface, target: Any, name: str, path: str = ""
    ):
        self._handle, self._interface = handle, interface
        self._name, self._path = name, path
        self.target = target  #: The object itself; None in a replay.

    def __getattr__(self, name: str) -> Any:
        interface, path = self._interface, f"{self._path}.{name}".lstrip(".")
        if name.startswith("_"):
            return getattr(self.target, name)
        if path in interface.parts:
            found: Any = self._other(getattr(self.target, name, None), path)
        elif name in interface.views:
            found = self._view(name)
        elif path in interface.reads:
            return self._value(path, "", lambda: getattr(self.target, name))
        else:
            found = self._method(name, path)
        # The next time it is found at once.
        setattr(self, name, found)
        return found

    def _other(self, target, path):
        return External(self._handle, self._interface, target, self._name, path)

    def _view(self, name):
        path = self._interface.views[name]

        def view(*arguments):
            target = self.target and getattr(self.target, name)(*map(_itself, arguments))
            return self._other(target, self._path if path is None else path)

        return view

    def _method(self, name, path):
        def call(*arguments, **named):
            shown = ""
            # Setpoints come often, and only a journal needs their texts.
            if self._handle.has_journal:
                shown = ", ".join(map(_described, (*arguments, *named.values())))

            def perform():
                return getattr(self.target, name)(*map(_itself, arguments), **named)

            return self._value(path, f"({shown})", perform)

        return call

    def _value(self, path, arguments, read):
        interface, handle = self._interface, self._handle
        what = f"{self._name} {path}{arguments}"
        value = handle.value(what, read, path in interface.waits, interface.errors)
        decode = interface.decode.get(path)
        return decode(value) if decode and handle.is_replay and value is not None else value


def _itself(argument):
    return argument.target if isinstance(argument, External) else argument


def _described(argument):
    if isinstance(argument, (list, tuple)):
        return f"[{', '.join(map(_described, argument))}]"
    is_plain = argument is None or isinstance(argument, (int, float, str, bytes))
    return repr(argument) if is_plain else type(argument).__name__
