"""Types of parameters: what a value may be, and what is expected in words.

A parameter type is called with the raw value, as the parameter server or a
command line has it, and returns the value that a node uses; or it raises
`ValueError`, with a reason where ``str(type)``, what is expected, does not say it.
"""

import math
from dataclasses import dataclass
from typing import Any

from crazyflie_utils.text_input import number_from_text


class ParameterType:
    """Base class of parameter types.

    Attributes
    ----------
    label : str
        For tables and command lines, such as "float".
    unit : str
        Of a number; empty for none.
    range : str
        For tables, such as "> 0"; empty for none.
    """

    label: str
    unit: str = ""
    range: str = ""

    def __call__(self, value: Any) -> Any:
        """Return the value that a raw value means.

        Raises
        ------
        ValueError
            It means none.
        """
        raise NotImplementedError

    def from_text(self, text: str) -> Any:
        """Return the raw value that a word on a command line means, or raise ValueError."""
        return text


@dataclass(frozen=True)
class Number(ParameterType):
    """A finite float.

    Attributes
    ----------
    unit : str
        For the message only.
    above : float
        The value must be greater than this.
    minimum, maximum : float
        The value must not be outside these.
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

    def from_text(self, text: str) -> float:
        """Return the number in a text."""
        return number_from_text(text)

    def __call__(self, value: Any) -> float:
        """Return the value as float."""
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ValueError
        try:
            number = float(value)
        except OverflowError as error:
            raise ValueError(error) from None
        if not math.isfinite(number) or not self.minimum <= number <= self.maximum:
            raise ValueError
        if number <= self.above:
            raise ValueError
        return number

    def __str__(self) -> str:
        """Return what is expected."""
        unit = f"({self.unit})" if self.unit else ""
        return " ".join(filter(None, ["a finite number", self.range, unit]))


@dataclass(frozen=True)
class Integer(ParameterType):
    """A whole number in [minimum, maximum]; 7.0 counts as 7."""

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

    def from_text(self, text: str) -> int:
        """Return the integer in a text; 0x begins a hexadecimal one."""
        # Python's own way to write large numbers is nobody else's.
        if "_" in text:
            raise ValueError
        return int(text, 0)

    def __call__(self, value: Any) -> int:
        """Return the value as int."""
        number = Number(minimum=self.minimum, maximum=self.maximum)(value)
        if number != int(number):
            raise ValueError
        return int(number)

    def __str__(self) -> str:
        """Return what is expected."""
        if self.minimum == self.maximum:
            return f"the integer {self.minimum}"
        return f"an integer from {self.minimum} to {self.maximum}"


@dataclass(frozen=True)
class Boolean(ParameterType):
    """true or false."""

    label = "bool"

    def from_text(self, text: str) -> bool:
        """Return what true or false means."""
        if text.lower() not in ("true", "false"):
            raise ValueError
        return text.lower() == "true"

    def __call__(self, value: Any) -> bool:
        """Return the value."""
        if not isinstance(value, bool):
            raise ValueError
        return value

    def __str__(self) -> str:
        """Return what is expected."""
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

    def __call__(self, value: Any) -> str:
        """Return the value."""
        if not isinstance(value, str) or not (value.strip() or self.may_be_empty):
            raise ValueError
        if self.choices and value not in self.choices:
            raise ValueError
        return value

    def __str__(self) -> str:
        """Return what is expected."""
        if self.choices:
            return "one of " + ", ".join(self.choices)
        return "a string" if self.may_be_empty else "a string that is not empty"


@dataclass(frozen=True)
class GraphName(ParameterType):
    """The name of a topic or a service."""

    label = "string"

    def __call__(self, value: Any) -> str:
        """Return the value."""
        if not isinstance(value, str) or not value:
            raise ValueError
        # Here, since programs without ROS have no such names.
        from rosgraph.names import is_legal_name

        if not is_legal_name(value):
            raise ValueError
        return value

    def __str__(self) -> str:
        """Return what is expected."""
        return "the name of a topic or service, such as /state"


@dataclass(frozen=True)
class Frame(ParameterType):
    """The name of a tf frame; a leading slash, as tf 1 wrote it, is dropped."""

    label = "string"

    def __call__(self, value: Any) -> str:
        """Return the frame's name as tf2 wants it."""
        if not isinstance(value, str) or not value.strip("/ "):
            raise ValueError
        return value.lstrip("/")

    def __str__(self) -> str:
        """Return what is expected."""
        return "the name of a tf frame, such as world"


@dataclass(frozen=True)
class ListOf(ParameterType):
    """A list whose entries are all of one type; as a value, a tuple.

    Attributes
    ----------
    entry : ParameterType
    length : int or None
        Number of entries; None for any.
    """

    entry: ParameterType
    length: int | None = None

    @property
    def label(self) -> str:  # type: ignore[override]
        """As the entry's."""
        return f"list of {self.entry.label}"

    @property
    def unit(self) -> str:  # type: ignore[override]
        """As the entry's."""
        return self.entry.unit

    @property
    def range(self) -> str:  # type: ignore[override]
        """As the entry's."""
        return self.entry.range

    def __call__(self, value: Any) -> tuple[Any, ...]:
        """Return the entries."""
        if not isinstance(value, (list, tuple)) or self.length not in (None, len(value)):
            raise ValueError
        return tuple(map(self.entry, value))

    def __str__(self) -> str:
        """Return what is expected."""
        count = "a list" if self.length is None else f"a list of {self.length}"
        return f"{count}, each entry {self.entry}"


FINITE = Number()
POSITIVE = Number(above=0.0)
DURATION = Number(unit="s", minimum=0.0)
TIME_STEP = Number(unit="s", minimum=1e-4)
"""A period of a node: with shorter ones it would do nothing else than to be late."""
METRES = Number(unit="m")
BOOLEAN = Boolean()
TEXT = Text()
TOPIC = GraphName()
SERVICE = GraphName()
FRAME = Frame()
POSITION = ListOf(METRES, 3)
