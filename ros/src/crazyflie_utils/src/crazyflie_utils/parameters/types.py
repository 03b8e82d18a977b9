"""Types of parameters: the allowed values, and their description (``str(type)``)."""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from typing_extensions import override

from crazyflie_utils.text import shown


class ParameterType:
    """Base class of parameter types."""

    label: str  #: For tables and command lines, such as "float".
    unit: str = ""  #: Unit of a number; empty without one.
    range: str = ""  #: Range for tables, such as "> 0"; empty without one.

    def __call__(self, value: Any) -> Any:
        """Return the value of a raw one from the parameter server or a command line.

        Raises ValueError if it is invalid; with a reason if ``str(type)`` does not contain it.
        """
        raise NotImplementedError


def checked(expected: ParameterType, raw: Any) -> Any:
    """Return the value of a raw one; ValueError says what it is, and what was expected."""
    try:
        return expected(raw)
    except (ValueError, TypeError, OverflowError) as error:
        # The texts of TypeError and OverflowError are Python's own, about something that is not a
        # number.
        reason = f" ({error})" if isinstance(error, ValueError) and str(error) else ""
        raise ValueError(f"is {shown(raw)}; expected {expected}{reason}") from None


@dataclass(frozen=True)
class Number(ParameterType):
    """A finite float: greater than ``above``, not outside ``minimum`` and ``maximum``."""

    unit: str = ""
    above: float = -math.inf
    minimum: float = -math.inf
    maximum: float = math.inf
    label = "float"

    @property
    def range(self) -> str:  # type: ignore[override]
        """The limits, such as "> 0"."""
        limits = [
            f"{sign} {limit:g}"
            for sign, limit in ((">", self.above), (">=", self.minimum), ("<=", self.maximum))
            if math.isfinite(limit)
        ]
        return " and ".join(limits)

    @override
    def __call__(self, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ValueError
        try:
            number = float(value)
        except OverflowError as error:
            raise ValueError(error) from None
        is_in_range = self.minimum <= number <= self.maximum and number > self.above
        if not math.isfinite(number) or not is_in_range:
            raise ValueError
        return number

    def __str__(self) -> str:
        unit = f"({self.unit})" if self.unit else ""
        return " ".join(filter(None, ["a finite number", self.range, unit]))


@dataclass(frozen=True)
class Integer(ParameterType):
    """A whole number in [minimum, maximum]; 7.0 is accepted as 7."""

    minimum: int
    maximum: int
    unit: str = ""
    label = "int"

    @property
    def range(self) -> str:  # type: ignore[override]
        """The limits, such as "0 to 255"."""
        if self.minimum == self.maximum:
            return f"{self.minimum}"
        return f"{self.minimum} to {self.maximum}"

    @override
    def __call__(self, value: Any) -> int:
        number = Number(minimum=self.minimum, maximum=self.maximum)(value)
        if number != int(number):
            raise ValueError
        return int(number)

    def __str__(self) -> str:
        if self.minimum == self.maximum:
            return f"the integer {self.minimum}"
        return f"an integer from {self.minimum} to {self.maximum}"


@dataclass(frozen=True)
class Boolean(ParameterType):
    """true or false."""

    label = "bool"

    @override
    def __call__(self, value: Any) -> bool:
        if not isinstance(value, bool):
            raise ValueError
        return value

    def __str__(self) -> str:
        return "true or false"


@dataclass(frozen=True)
class Text(ParameterType):
    """A string; one of ``choices``, if there are any; empty only if it ``may_be_empty``."""

    choices: tuple[str, ...] = ()
    may_be_empty: bool = False
    label = "string"

    @property
    def range(self) -> str:  # type: ignore[override]
        """The choices."""
        return ", ".join(f"`{choice}`" for choice in self.choices)

    @override
    def __call__(self, value: Any) -> str:
        if not isinstance(value, str) or not (value.strip() or self.may_be_empty):
            raise ValueError
        if value not in (self.choices or (value,)):
            raise ValueError
        return value

    def __str__(self) -> str:
        if self.choices:
            return "one of " + ", ".join(self.choices)
        return "a string" if self.may_be_empty else "a string that is not empty"


@dataclass(frozen=True)
class Converted(ParameterType):
    """A type whose value is ``convert(raw value)``, which raises as `ParameterType.__call__`."""

    convert: Callable[[Any], Any]
    expected: str  #: Description for messages, such as "a world file".
    label: str = "string"
    unit: str = ""
    range: str = ""

    @override
    def __call__(self, value: Any) -> Any:
        return self.convert(value)

    def __str__(self) -> str:
        return self.expected


def matching(pattern: str, expected: str) -> Converted:
    """Return the type of a string that matches a regular expression, in ASCII, as a whole."""

    def convert(value: Any) -> str:
        if not isinstance(value, str) or not re.fullmatch(pattern, value, re.ASCII):
            raise ValueError
        return value

    return Converted(convert, expected)


def path_of(load: Callable[[str], Any], content: str) -> Converted:
    """Return the type of a file's path; its value is that of ``load(path)``, which may raise.

    The content is for messages, such as "a world file".
    """
    return Converted(lambda path: load(TEXT(path)), f"the path of {content}")


def _graph_name(value):
    # Imported here, since programs without ROS have no such names.
    from rosgraph.names import is_legal_name

    if not isinstance(value, str) or not value or not is_legal_name(value):
        raise ValueError
    return value


def _frame_name(value):
    # A leading slash is tf 1's.
    if not isinstance(value, str) or not value.strip("/ "):
        raise ValueError
    return value.lstrip("/")


@dataclass(frozen=True)
class ListOf(ParameterType):
    """A list with entries of one type; its value is a tuple. ``length`` None: any length."""

    entry: ParameterType
    length: int | None = None

    @property
    def label(self) -> str:  # type: ignore[override]
        """The same property of the entries."""
        return f"list of {self.entry.label}"

    @property
    def unit(self) -> str:  # type: ignore[override]
        """The same property of the entries."""
        return self.entry.unit

    @property
    def range(self) -> str:  # type: ignore[override]
        """The same property of the entries."""
        return self.entry.range

    @override
    def __call__(self, value: Any) -> tuple[Any, ...]:
        if not isinstance(value, (list, tuple)) or self.length not in (None, len(value)):
            raise ValueError
        return tuple(map(self.entry, value))

    def __str__(self) -> str:
        count = "a list" if self.length is None else f"a list of {self.length}"
        return f"{count}, each entry {self.entry}"


FINITE = Number()
POSITIVE = Number(above=0.0)
DURATION = Number(unit="s", minimum=0.0)
#: Shortest period of a node, which could not keep up with a shorter one.
TIME_STEP = Number(unit="s", minimum=1e-4)
METRES = Number(unit="m")
BOOLEAN = Boolean()
TEXT = Text()
TOPIC = SERVICE = Converted(_graph_name, "the name of a topic or service, such as /state")
FRAME = Converted(_frame_name, "the name of a tf frame, such as world")
POSITION = ListOf(METRES, 3)
