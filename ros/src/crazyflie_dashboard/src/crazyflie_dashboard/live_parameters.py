"""Parameters that may be changed while nodes run: by dynamic_reconfigure, or by the driver."""

import ast
import math
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from typing import Any

from dynamic_reconfigure.msg import Config, ConfigDescription
from dynamic_reconfigure.srv import Reconfigure, ReconfigureRequest

from crazyflie_dashboard.graph_model import GraphModel
from crazyflie_dashboard.page_data import ParameterInfo
from crazyflie_driver.srv import UpdateParams, UpdateParamsRequest
from crazyflie_utils import ServiceError
from crazyflie_utils.parameters.server import config_message
from crazyflie_utils.parameters.types import FIRMWARE_NUMBER
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.steps import Steps
from crazyflie_utils.text import number_from_text

_TIMEOUT = 3.0  #: Longest time for a latched message of a node, by the machine's clock (s).
_CALL_TIMEOUT = 5.0  #: Longest time for a change (s).

_SERVICE = "/set_parameters"

#: Types of dynamic_reconfigure -> kinds.
_KINDS = {"double": "float", "int": "int", "bool": "bool", "str": "str"}


def values_of(config: Config) -> dict[str, Any]:
    """Return name to value of a dynamic_reconfigure/Config."""
    rows = (*config.bools, *config.ints, *config.strs, *config.doubles)
    return {each.name: each.value for each in rows}


def described(node: str, description: ConfigDescription, config: Config) -> Iterator[ParameterInfo]:
    """Yield the live parameters of a node, as its own messages describe them."""
    low, high, values = map(values_of, (description.min, description.max, config))
    for group in description.groups:
        for each in group.parameters:
            kind = _KINDS.get(each.type)
            if kind is None or each.name not in values:
                continue
            is_number = kind in ("float", "int")
            text, _, unit = each.description.rpartition(", ") if is_number else ("", "", "")
            # The unit, if any, is a short word behind the last comma.
            has_unit = bool(text) and len(unit) <= 10 and " " not in unit.strip()
            yield ParameterInfo(
                owner=node,
                name=each.name,
                kind=kind,
                value=values[each.name],
                unit=unit if has_unit else "",
                help=text if has_unit else each.description,
                minimum=_finite(low.get(each.name)) if is_number else None,
                maximum=_finite(high.get(each.name)) if is_number else None,
                choices=_choices(each.edit_method),
            )


def of_firmware(vehicle: str, tree: Mapping[str, Any]) -> Iterator[ParameterInfo]:
    """Yield the firmware parameters among those below a vehicle on the parameter server.

    The driver mirrors them as GROUP/NAME. Nodes there also have texts or namespaces.
    """
    for group, parameters in sorted(tree.items()):
        if not isinstance(parameters, dict):
            continue
        try:
            numbers = {name: FIRMWARE_NUMBER(value) for name, value in parameters.items()}
        except ValueError:
            continue
        for name, value in sorted(numbers.items()):
            # A text, as of 2e0, does not tell which one it is.
            kind = "int" if isinstance(parameters[name], int) else "float"
            yield ParameterInfo(vehicle, f"{group}.{name}", kind, value, is_firmware=True)


def parsed(parameter: ParameterInfo, text: str) -> bool | int | float | str:
    """Return the typed value.

    `RefusalError`: it is not of this kind, out of range, or not one of the choices.
    """
    where = f"{parameter.owner}: {parameter.name} is {text!r}; expected"
    word = text.strip()
    try:
        if parameter.kind == "bool":
            value: Any = {"true": True, "1": True, "false": False, "0": False}[word.lower()]
        elif parameter.kind in ("int", "float"):
            value = number_from_text(word)
            if parameter.kind == "int":
                if not value.is_integer():
                    raise ValueError
                value = int(value)
        else:
            value = text
    except (KeyError, ValueError):
        kinds = {"bool": "true or false", "int": "a whole number", "float": "a number"}
        raise RefusalError(f"{where} {kinds[parameter.kind]}") from None
    low, high = parameter.minimum, parameter.maximum
    if parameter.kind in ("int", "float") and not (
        (low is None or value >= low) and (high is None or value <= high) and math.isfinite(value)
    ):
        limits = range_of(parameter) or "a finite number"
        raise RefusalError(f"{where} {limits} {parameter.unit}".rstrip())
    if parameter.choices and value not in parameter.choices:
        raise RefusalError(f"{where} one of {', '.join(parameter.choices)}")
    return value


def range_of(parameter: ParameterInfo) -> str:
    """Return the range of a number in words; nothing if it has none."""
    low, high = parameter.minimum, parameter.maximum
    if low is not None and high is not None:
        return f"{low:g} to {high:g}"
    if low is not None:
        return f"at least {low:g}"
    return "" if high is None else f"at most {high:g}"


def _finite(value):
    return value if value is not None and abs(value) < 1e300 else None


def _choices(text):
    try:
        return tuple(str(each["value"]) for each in ast.literal_eval(text)["enum"]) if text else ()
    except (ValueError, SyntaxError, KeyError, TypeError):
        return ()


class LiveParameters:
    """Reads and sets parameters; see `Dashboard.parameters`."""

    def __init__(self, model: GraphModel):
        self._model, self._handle = model, model.handle

    def owners(self) -> tuple[str, ...]:
        """Return nodes with live parameters, and vehicles with firmware."""
        services = self._model.graph.services
        nodes = [name.removesuffix(_SERVICE) for name in services if name.endswith(_SERVICE)]
        return (*self._firmware(), *sorted(nodes))

    def of(self, owner: str) -> Steps[tuple[ParameterInfo, ...]]:
        """Return the parameters of a node or of a vehicle's firmware."""
        owners = self.owners()
        if owner not in owners:
            raise RefusalError(
                f"{owner} has no live parameters; expected one of {', '.join(owners)}"
            )
        driver = self._firmware().get(owner)
        if driver is None:
            return (yield from self._of_node(owner))
        top = driver or "/"
        known = yield self._model.workers.submit(self._model.master.parameters, [top])
        tree = known.get(top)
        return tuple(of_firmware(owner, tree if isinstance(tree, dict) else {}))

    def set(self, parameter: ParameterInfo, text: str) -> Steps[ParameterInfo]:
        """Set a parameter to the typed value; the result has the value that came back."""
        value = parsed(parameter, text)
        if parameter.is_firmware:
            return (yield from self._set_firmware(parameter, value))
        service, config = f"{parameter.owner}{_SERVICE}", config_message({parameter.name: value})
        answer = yield self._handle.call_service(
            service, Reconfigure, ReconfigureRequest(config), _CALL_TIMEOUT
        )
        return replace(parameter, value=values_of(answer.config).get(parameter.name, value))

    def _firmware(self):
        """Return the namespaces of drivers, by vehicle."""
        services = self._model.graph.services
        drivers = {name: model.vehicle.driver for name, model in [*self._model.models.items()]}
        return {name: top for name, top in drivers.items() if f"{top}/update_params" in services}

    def _set_firmware(self, parameter, value):
        top, name = self._firmware().get(parameter.owner), parameter.name.replace(".", "/")
        if top is None:
            raise RefusalError(f"{parameter.owner} has no driver; expected one")
        full_name = f"{top}/{name}"
        yield self._handle.set_param_later(full_name, value)
        try:
            yield self._handle.call_service(
                f"{top}/update_params", UpdateParams, UpdateParamsRequest([name]), _CALL_TIMEOUT
            )
        except ServiceError:
            # The firmware's value, which may differ from the typed one.
            yield self._handle.set_param_later(full_name, parameter.value)
            raise
        known = yield self._model.workers.submit(self._model.master.parameters, [full_name])
        return replace(parameter, value=known.get(full_name, value))

    def _of_node(self, node):
        handle = self._handle.child()
        end: Future[None] = Future()
        received: dict[str, Any] = {}

        def finish():
            if not end.done():
                end.set_result(None)

        def note(name, message):
            received[name] = message
            if len(received) == 2:
                finish()

        note_description, note_config = (partial(note, each) for each in ("description", "config"))
        handle.subscribe(f"{node}/parameter_descriptions", ConfigDescription, note_description)
        handle.subscribe(f"{node}/parameter_updates", Config, note_config)
        handle.timer(_TIMEOUT, finish, steady=True)
        yield end
        handle.close()
        return tuple(described(node, **received)) if len(received) == 2 else ()
