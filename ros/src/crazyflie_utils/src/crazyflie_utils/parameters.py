"""What a parameter may be, said once and checked before anything can fly.

A *kind* turns the raw value from the parameter server into the value a node
uses, or raises `ValueError`; ``str(kind)`` is what the operator is told was
expected.
"""

import math
from dataclasses import dataclass

import rosgraph.names


class ParameterError(Exception):
    """A parameter is missing or unusable; the text names it in full."""


@dataclass(frozen=True)
class Number:
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

    def __call__(self, value) -> float:
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
        text = "a finite number"
        if self.above > -math.inf:
            text += f" > {self.above:g}"
        if self.minimum > -math.inf:
            text += f" >= {self.minimum:g}"
        if self.maximum < math.inf:
            text += f" <= {self.maximum:g}"
        return text + (f" ({self.unit})" if self.unit else "")


@dataclass(frozen=True)
class Integer:
    """A whole number in [minimum, maximum]; 7.0 counts as 7."""

    minimum: int
    maximum: int

    def __call__(self, value) -> int:
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
class Boolean:
    """true or false."""

    def __call__(self, value) -> bool:
        """Return the value."""
        if not isinstance(value, bool):
            raise ValueError
        return value

    def __str__(self) -> str:
        """Return what is expected."""
        return "true or false"


@dataclass(frozen=True)
class Text:
    """A string that is not empty; of ``choices``, if there are any."""

    choices: tuple = ()

    def __call__(self, value) -> str:
        """Return the value."""
        if not isinstance(value, str) or not value.strip():
            raise ValueError
        if self.choices and value not in self.choices:
            raise ValueError
        return value

    def __str__(self) -> str:
        """Return what is expected."""
        if self.choices:
            return "one of " + ", ".join(self.choices)
        return "a string that is not empty"


@dataclass(frozen=True)
class GraphName:
    """The name of a topic or a service."""

    def __call__(self, value) -> str:
        """Return the value."""
        if not isinstance(value, str) or not value:
            raise ValueError
        if not rosgraph.names.is_legal_name(value):
            raise ValueError
        return value

    def __str__(self) -> str:
        """Return what is expected."""
        return "the name of a topic or service, such as /state"


@dataclass(frozen=True)
class Frame:
    """The name of a tf frame; a leading slash, as tf 1 wrote it, is dropped."""

    def __call__(self, value) -> str:
        """Return the frame's name as tf2 wants it."""
        if not isinstance(value, str) or not value.strip("/ "):
            raise ValueError
        return value.lstrip("/")

    def __str__(self) -> str:
        """Return what is expected."""
        return "the name of a tf frame, such as world"


FINITE = Number()
POSITIVE = Number(above=0.0)
DURATION = Number(unit="s", minimum=0.0)
TIME_STEP = Number(unit="s", above=0.0)
METRES = Number(unit="m")
BOOLEAN = Boolean()
TEXT = Text()
TOPIC = GraphName()
SERVICE = GraphName()
FRAME = Frame()
