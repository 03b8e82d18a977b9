"""Parameters, declared once: a class whose fields say name, type, default and help.

A declaration defines the checks at start, the tables in the READMEs, command lines, and the
parameters that dynamic_reconfigure may change in flight::

    class LimiterParameters(Parameters):
        limit: float = parameter(Number("m/s^2", above=0.0), "largest thrust", live=True)
        control_topic: str = parameter(TOPIC, "where controls come from", name="topics/control")
"""

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Self, dataclass_transform

from crazyflie_utils.parameters.types import TOPIC, ParameterType, checked

REQUIRED = dataclasses.MISSING  #: Default of a parameter that must be set.

_KEY = "declaration"


class ParameterError(Exception):
    """Parameters are missing or invalid; each complaint names one of them in full."""

    def __init__(self, *complaints: str):
        super().__init__("\n".join(complaints))
        self.complaints = complaints


class Complaints(list[str]):
    """Collects error texts: those of each `ParameterError` in ``with complaints:``, which ends."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _: object, error: BaseException | None, trace: object) -> bool:
        if isinstance(error, ParameterError):
            self += error.complaints
        return isinstance(error, ParameterError)

    def raise_any(self) -> None:
        """Raise `ParameterError` with all texts, if there are any."""
        if self:
            raise ParameterError(*dict.fromkeys(self))


@dataclasses.dataclass(frozen=True)
class Declaration:
    """The declaration of a parameter."""

    #: Below the node's name, such as "topics/state"; a name that begins with a slash is not the
    #: node's own.
    name: str
    type: ParameterType
    help: str  #: Description, without type, unit, range and default.
    default: Any  #: Value, not checked, if the parameter is not set; `REQUIRED`: no default.
    live: bool  #: Whether it may be changed while the node runs.


@dataclasses.dataclass(frozen=True)
class _Group:
    prefix: str
    type: "type[Parameters]"


def parameter(
    type: ParameterType,  # noqa: A002
    help: str,  # noqa: A002
    default: Any = REQUIRED,
    name: str = "",
    live: bool = False,
) -> Any:
    """Declare a field of a `Parameters` class; an empty name is the field's. See `Declaration`."""
    declaration = Declaration(name, type, help, default, live)
    return dataclasses.field(default=default, metadata={_KEY: declaration})


def topic(name: str, help: str, default: Any = REQUIRED) -> Any:  # noqa: A002
    """Declare the parameter topics/NAME, the name of a topic; see `parameter`."""
    return parameter(TOPIC, help, default, f"topics/{name}")


def group(type: "type[Parameters]", prefix: str) -> Any:  # noqa: A002
    """Declare a field that holds further parameters, whose names begin with ``prefix/``."""
    return dataclasses.field(metadata={_KEY: _Group(prefix, type)})


@dataclass_transform(
    frozen_default=True, kw_only_default=True, field_specifiers=(parameter, topic, group)
)
class Parameters:
    """Base class of declarations; an object of a subclass has checked values.

    A subclass is a frozen dataclass whose arguments are given by name. A field that is not declared
    is not a parameter: it has a default, and is set by `dataclasses.replace`.
    """

    def __init_subclass__(cls) -> None:
        dataclasses.dataclass(frozen=True, kw_only=True)(cls)

    def complaints(self) -> Iterable[str]:
        """Return an error text for each combination of valid values that is invalid."""
        return ()

    @classmethod
    def declarations(cls) -> Iterator[Declaration]:
        """Yield every declaration, those of groups with their full names."""
        for _, declaration in cls._fields():
            if isinstance(declaration, _Group):
                for inner in declaration.type.declarations():
                    yield dataclasses.replace(inner, name=f"{declaration.prefix}/{inner.name}")
            else:
                yield declaration

    @classmethod
    def read(cls, get: Callable[[str], Any], full_name: Callable[[str], str] = str) -> Self:
        """Return the parameters of a source, all of them checked.

        ``get(name)`` returns the raw value of a parameter, or raises KeyError; ``full_name(name)``
        is its name in messages. `ParameterError` lists everything that is missing or invalid.
        """
        values: dict[str, Any] = {}
        complaints = Complaints()
        for field, declaration in cls._fields():
            with complaints:
                values[field] = _read_field(declaration, get, full_name)
        complaints.raise_any()
        parameters = cls(**values)
        Complaints(parameters.complaints()).raise_any()
        return parameters

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any], prefix: str = "") -> Self:
        """Return the parameters in a mapping; messages call each ``prefix`` and its name.

        Raises `ParameterError`, see `read`; also for names that are not declared.
        """
        known = {declaration.name for declaration in cls.declarations()}
        complaints = Complaints(
            f"{prefix}{name} is not a parameter; expected one of {', '.join(sorted(known))}"
            for name in values
            if name not in known
        )
        with complaints:
            parameters = cls.read(values.__getitem__, lambda name: prefix + name)
        complaints.raise_any()
        return parameters

    @classmethod
    def _fields(cls) -> Iterator[tuple[str, Declaration | _Group]]:
        for field in dataclasses.fields(cls):  # type: ignore[arg-type]
            declaration = field.metadata.get(_KEY)
            if declaration is None:
                continue
            if isinstance(declaration, Declaration) and not declaration.name:
                declaration = dataclasses.replace(declaration, name=field.name)
            yield field.name, declaration


def read_parameter(
    declaration: Declaration, get: Callable[[str], Any], full_name: Callable[[str], str] = str
) -> Any:
    """Return one parameter, checked; see `Parameters.read`."""
    try:
        raw = get(declaration.name)
    except KeyError:
        if declaration.default is not REQUIRED:
            return declaration.default
        raise ParameterError(
            f"parameter {full_name(declaration.name)} is not set; expected {declaration.type}"
        ) from None
    try:
        return checked(declaration.type, raw)
    except ValueError as error:
        raise ParameterError(f"parameter {full_name(declaration.name)} {error}") from None


def _read_field(declaration, get, full_name):
    if isinstance(declaration, Declaration):
        return read_parameter(declaration, get, full_name)
    return declaration.type.read(
        lambda name: get(f"{declaration.prefix}/{name}"),
        lambda name: full_name(f"{declaration.prefix}/{name}"),
    )
