"""One figure that is measured, beside what it is to reach."""

import math
from collections.abc import Callable
from dataclasses import dataclass


class NotMeasuredError(Exception):
    """A figure cannot be had here; the text says why."""


@dataclass(frozen=True)
class Row:
    """A figure."""

    name: str  #: A word for the command line.
    text: str  #: What it is.
    unit: str
    measure: Callable[[], float]  #: Returns the figure, a float. Raises `NotMeasuredError`.
    #: least, most: The goal: where the figure is to be.
    least: float = -math.inf
    most: float = math.inf
    seconds: float = 12.0  #: About how long it takes to measure, s.

    @property
    def goal(self) -> str:
        """The goal in words."""
        if math.isinf(self.least) and math.isinf(self.most):
            return "-"
        if math.isinf(self.least):
            return f"<= {self.most:g}"
        if math.isinf(self.most):
            return f">= {self.least:g}"
        return f"{self.least:g} ... {self.most:g}"

    def is_reached(self, value: float) -> bool:
        """Tell whether a value is within the goal."""
        return self.least <= value <= self.most
