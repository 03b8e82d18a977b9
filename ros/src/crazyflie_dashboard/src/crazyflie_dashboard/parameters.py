"""Parameters that may be changed while nodes run, and those of firmware."""

import ast
import math
from collections.abc import Iterator, Mapping
from typing import Any

from dynamic_reconfigure.msg import Config, ConfigDescription

from crazyflie_dashboard.page_data import ParameterInfo
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.text import number_from_text

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
        if not all(isinstance(value, (int, float)) for value in parameters.values()):
            continue
        for name, value in sorted(parameters.items()):
            kind = "float" if isinstance(value, float) else "int"
            yield ParameterInfo(vehicle, f"{group}.{name}", kind, value, is_firmware=True)


def parsed(parameter: ParameterInfo, text: str) -> bool | int | float | str:
    """Return the typed value.

    Raises
    ------
    RefusalError
        It is not of this kind, out of range, or not one of the choices.
    """
    where = f"{parameter.owner}: {parameter.name} is {text!r}; expected"
    word = text.strip()
    try:
        if parameter.kind == "bool":
            value: Any = {"true": True, "1": True, "false": False, "0": False}[word.lower()]
        elif parameter.kind == "int":
            value = int(word, 0)
        elif parameter.kind == "float":
            value = number_from_text(word)
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
