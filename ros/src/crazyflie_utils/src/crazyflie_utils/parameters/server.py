"""Parameters of a running node: on the parameter server, and changes in flight.

A node reads its own parameters in one request; a thread sets them. dynamic_reconfigure and
rqt_reconfigure change them through the node handle, between two callbacks; the library's own server
uses threads of rospy. Only the library's messages are imported: its other modules load two hundred
modules (20 MiB) that find packages in the file system.
"""

import contextlib
import difflib
import threading
from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import Future
from typing import Any

from dynamic_reconfigure.msg import (
    BoolParameter,
    Config,
    ConfigDescription,
    DoubleParameter,
    Group,
    IntParameter,
    ParamDescription,
    StrParameter,
)
from dynamic_reconfigure.srv import Reconfigure, ReconfigureResponse

from crazyflie_utils.parameters.declaration import REQUIRED, ParameterError, Parameters
from crazyflie_utils.parameters.types import BOOLEAN, Integer, Number, Text
from crazyflie_utils.refusal import ServiceError


class PrivateParameters:
    """The parameters below the absolute name of a node, and those to which names are remapped.

    For ``get_param`` and ``resolve`` see `Transport` and `NodeHandle`.
    """

    def __init__(self, get_param: Callable[[str], Any], node: str, resolve: Callable[[str], str]):
        self._get_param = get_param
        self._prefix = node + "/"
        self._resolve = resolve
        self.asked_for: set[str] = set()  #: Absolute names of parameters that were asked for.
        try:
            self._own = get_param(node)
        except KeyError:
            self._own = {}

    def unknown(self, known: Collection[str]) -> str:
        """Return the node's parameters that are not among, or below, absolute names, as words."""
        names = [name.removeprefix(self._prefix) for name in known if name.startswith(self._prefix)]
        found = []
        for path, _ in leaves(self._own):
            if any(f"{path}/".startswith(f"{name}/") for name in names):
                continue
            near = difflib.get_close_matches(path, names, 1)
            found.append(f"~{path}" + (f" (~{near[0]}?)" if near else ""))
        return ", ".join(found)

    def full_name(self, name: str) -> str:
        """Return the absolute name of a parameter: of the node, unless it begins with a slash."""
        return self._resolve(name if name.startswith("/") else "~" + name)

    def get(self, name: str) -> Any:
        """Return the raw value of a parameter; KeyError without."""
        full_name = self.full_name(name)
        self.asked_for.add(full_name)
        if not full_name.startswith(self._prefix):
            return self._get_param(full_name)
        value = self._own
        for key in full_name.removeprefix(self._prefix).split("/"):
            if not isinstance(value, dict):
                raise KeyError(name)
            value = value[key]
        return value


def leaves(tree: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield name and value of each parameter in a tree of dictionaries, in which "/" is a level."""
    if not isinstance(tree, dict):
        yield path, tree
        return
    for key, value in tree.items():
        yield from leaves(value, f"{path}/{key}" if path else str(key))


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


class Reconfiguration:
    """Offers the live parameters of a node, which ``get`` returns; see `NodeHandle.load`.

    The handle is a `NodeHandle`, whose module imports this one.
    """

    def __init__(
        self,
        handle: Any,
        parameters: Parameters,
        get: Callable[[str], Any],
        on_change: Callable[[Any], None],
    ):
        self._handle = handle
        self._type = type(parameters)
        self._on_change = on_change
        declarations = [*self._type.declarations()]
        # All are read now: at a change, in flight, no callback may wait for the master.
        self._values: dict[str, Any] = {}
        for declaration in declarations:
            with contextlib.suppress(KeyError):
                self._values[declaration.name] = get(declaration.name)
        self._live = {d.name: d for d in declarations if d.live}
        descriptions = handle.publisher("~parameter_descriptions", ConfigDescription, latch=True)
        self._updates = handle.publisher("~parameter_updates", Config, latch=True)
        descriptions.publish(_description(self._live.values(), self._config()))
        self._updates.publish(config_message(self._config()))
        handle.advertise_service("~set_parameters", Reconfigure, self._on_set_parameters)

    def _on_set_parameters(self, request):
        sent = request.config
        wanted = {
            parameter.name: parameter.value
            for parameter in (*sent.bools, *sent.ints, *sent.strs, *sent.doubles)
        }
        try:
            self._apply(wanted)
        except ParameterError as error:
            raise ServiceError(str(error)) from None
        finally:
            # Also after a refusal: programs that show the configuration get what holds.
            self._updates.publish(config_message(self._config()))
        for name, value in wanted.items():
            self._handle.set_param_later(f"~{name}", value)
        return ReconfigureResponse(config_message(self._config()))

    def _apply(self, wanted):
        if unknown := wanted.keys() - self._live.keys():
            raise ParameterError(
                f"{', '.join(sorted(unknown))} cannot be changed while {self._handle.name} runs; "
                f"expected names among {', '.join(self._live)}"
            )
        values = {**self._values, **wanted}
        full_name = self._handle.resolve
        self._on_change(self._type.read(values.__getitem__, lambda name: full_name(f"~{name}")))
        self._values = values

    def _config(self):
        return {
            name: _python_type(each)(self._values.get(name, each.default))
            for name, each in self._live.items()
        }


def _python_type(declaration):
    # What is neither a number nor a bool is sent as text, such as the path of a file.
    return {"float": float, "int": int, "bool": bool}.get(declaration.type.label, str)


def config_message(values: Mapping[str, bool | int | float | str]) -> Config:
    """Return values, by the parameter's name, as dynamic_reconfigure sends them."""
    message = Config()
    for name, value in values.items():
        # A bool is an int, too.
        if isinstance(value, bool):
            message.bools.append(BoolParameter(name, value))
        elif isinstance(value, int):
            message.ints.append(IntParameter(name, value))
        elif isinstance(value, float):
            message.doubles.append(DoubleParameter(name, value))
        else:
            message.strs.append(StrParameter(name, value))
    return message


def _description(live, config):
    low, high, defaults = {}, {}, {}
    group = Group(name="Default")
    for declaration in live:
        name, kind, python_type = declaration.name, declaration.type, _python_type(declaration)
        low[name], high[name] = _limits(kind)
        has_default = declaration.default is not REQUIRED
        defaults[name] = python_type(declaration.default) if has_default else config[name]
        wire_type = "double" if python_type is float else python_type.__name__
        text = f"{declaration.help}{f', {kind.unit}' if kind.unit else ''}"
        group.parameters.append(ParamDescription(name, wire_type, 0, text, _choices(kind)))
    return ConfigDescription(
        [group], config_message(high), config_message(low), config_message(defaults)
    )


def _limits(kind):
    if isinstance(kind, Number):
        return max(kind.minimum, kind.above), kind.maximum
    if isinstance(kind, Integer):
        return kind.minimum, kind.maximum
    return (False, True) if kind is BOOLEAN else ("", "")


def _choices(parameter_type):
    # A Python literal in a string, as dynamic_reconfigure's own generator writes it.
    if not isinstance(parameter_type, Text) or not parameter_type.choices:
        return ""
    choices = [
        {"name": name, "type": "str", "value": name, "description": ""}
        for name in parameter_type.choices
    ]
    return repr({"enum": choices, "enum_description": ""})
