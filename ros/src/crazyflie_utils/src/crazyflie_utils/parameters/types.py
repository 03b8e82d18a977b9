"""Types of parameters: the allowed values, and their description (``str(type)``)."""

import contextlib
import math
import os
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from typing_extensions import override

from crazyflie_utils.text import number_from_text, shown
from crazyflie_utils.text_file import user_path


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
    """A finite float: greater than ``above``, not outside ``minimum`` and ``maximum``.

    Texts are read by `number_from_text`: 1e-3 is a text in YAML 1.1, and so for rosparam.
    """

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
        if isinstance(value, str):
            with contextlib.suppress(ValueError):
                value = number_from_text(value)
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not (is_number and abs(value) <= sys.float_info.max):
            raise ValueError
        if not self.minimum <= value <= self.maximum or value <= self.above:
            raise ValueError
        return float(value)

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
        low, high = self.minimum, self.maximum
        return f"{low}" if low == high else f"{low} to {high}"

    @override
    def __call__(self, value: Any) -> int:
        number = Number(minimum=self.minimum, maximum=self.maximum)(value)
        if number != int(number):
            raise ValueError
        return int(number)

    def __str__(self) -> str:
        one = self.minimum == self.maximum
        return f"{'the integer' if one else 'an integer from'} {self.range}"


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
        is_text = isinstance(value, str) and (value.strip() or self.may_be_empty)
        if not is_text or value not in (self.choices or (value,)):
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


class ListOf(Converted):
    """A list with entries of one type; its value is a tuple. ``length`` None: any length."""

    def __init__(self, entry: ParameterType, length: int | None = None):
        def convert(value: Any) -> tuple[Any, ...]:
            if not isinstance(value, (list, tuple)) or length not in (None, len(value)):
                raise ValueError
            return tuple(map(entry, value))

        expected = f"a list{'' if length is None else f' of {length}'}, each entry {entry}"
        label = f"list of {entry.label}"
        super().__init__(convert, expected, label, entry.unit, entry.range)


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


def _boolean(value):
    if not isinstance(value, bool):
        raise ValueError
    return value


def _firmware_number(value):
    if isinstance(value, bool):
        return int(value)
    number = FINITE(value)
    if not isinstance(value, str):
        return value
    is_integer = number.is_integer() and abs(number) < 2.0**53
    return int(number) if is_integer else number


FINITE = Number()
#: The value of a firmware parameter, an int or a float; true is 1.
FIRMWARE_NUMBER = Converted(_firmware_number, str(FINITE), "float")
POSITIVE = Number(above=0.0)
SHARE = Number(minimum=0.0, maximum=1.0)
PORT = Integer(1, 65535)
DURATION = Number(unit="s", minimum=0.0)
#: Shortest period of a node, which could not keep up with a shorter one.
TIME_STEP = Number(unit="s", minimum=1e-4)
METRES = Number(unit="m")
BOOLEAN = Converted(_boolean, "true or false", "bool")
TEXT = Text()
#: Path of a file or folder; its value is absolute, with the home folder in place of ~.
FILE = Converted(lambda value: os.path.abspath(user_path(TEXT(value))), str(TEXT))
TOPIC = SERVICE = Converted(_graph_name, "the name of a topic or service, such as /state")
FRAME = Converted(_frame_name, "the name of a tf frame, such as world")
POSITION = ListOf(METRES, 3)
