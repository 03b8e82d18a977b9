"""What the subsystems of a vehicle have in common: a link, tables of names."""

import copy
from collections.abc import Callable
from typing import Protocol, Self, TypeVar, cast

from crazyflie_link.guarded_link import GuardedLink, MaySend
from crazyflie_link.link import Link


class Subsystem:
    """A part of the firmware, spoken to over the vehicle's present link.

    Parameters
    ----------
    current_link : callable
        Returns the living `Link`, or raises `LinkLostError`.
    """

    def __init__(self, current_link: Callable[[], Link]):
        self._current_link = current_link

    def guarded(self, may_send: MaySend) -> Self:
        """Return the same subsystem, but its commands and requests go out only if ``may_send()``.

        Parameters
        ----------
        may_send : callable
            Is called by the thread that sends, right before each packet.
        """
        guarded, current_link = copy.copy(self), self._current_link
        guarded._current_link = lambda: cast(Link, GuardedLink(current_link(), may_send))
        return guarded


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
