"""Base class of the parts of the firmware, and the tables of its names."""

import copy
from collections.abc import Callable
from typing import Any, Self, TypeVar, cast

from crazyflie_link.link import Link
from crazyflie_link.request_reply import Request
from crazyflie_link.transmit_queue import Send

#: Is called in the thread that sends, right before each packet: whether it is sent.
MaySend = Callable[[], bool]


class _GuardedLink:
    """A `Link` whose commands and requests are sent only if ``may_send()``.

    A request that is held back ends as one that is not answered does.
    """

    def __init__(self, link: Link, may_send: MaySend):
        self._link = link
        self._may_send = may_send

    def __getattr__(self, name: str) -> Any:
        return getattr(self._link, name)

    def put(self, send: Send, urgent: bool = False) -> None:
        def transmit():
            if self._may_send():
                send()

        self._link.put(transmit, urgent)

    def request(self, send: Send | bytes, request: Request) -> bytes:
        return self._link.request(send, request, self.put)


class Subsystem:
    """A part of the firmware, spoken to over the vehicle's present link."""

    def __init__(self, current_link: Callable[[], Link]):
        self._current_link = current_link

    def guarded(self, may_send: MaySend) -> Self:
        """Return the same subsystem, whose commands and requests go out only if ``may_send()``."""
        guarded, current_link = copy.copy(self), self._current_link
        guarded._current_link = lambda: cast(Link, _GuardedLink(current_link(), may_send))
        return guarded


Element = TypeVar("Element")


def elements(table: dict[str, dict[str, Element]]) -> dict[str, Element]:
    """Return the elements of one of cflib's tables: "group.name" -> element, sorted by name."""
    return {
        f"{group}.{name}": element
        for group, names in sorted(table.items())
        for name, element in sorted(names.items())
    }
