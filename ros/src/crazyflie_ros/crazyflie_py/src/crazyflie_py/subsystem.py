"""What the subsystems of a vehicle have in common: a link, tables of names."""

from collections.abc import Callable
from typing import Protocol, TypeVar

from crazyflie_py.link import Link


class Subsystem:
    """A part of the firmware, spoken to over the vehicle's present link.

    Parameters
    ----------
    current_link : callable
        Returns the living `Link`, or raises `LinkLostError`.
    """

    def __init__(self, current_link: Callable[[], Link]):
        self._current_link = current_link


class TableElement(Protocol):
    """An element of cflib's table of parameters or of log variables."""

    ctype: str


E = TypeVar("E", bound=TableElement)


def elements(table: dict[str, dict[str, E]]) -> dict[str, E]:
    """Return the elements of one of cflib's tables: "group.name" -> element, sorted by name."""
    return {
        f"{group}.{name}": element
        for group, names in sorted(table.items())
        for name, element in sorted(names.items())
    }
