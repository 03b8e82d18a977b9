"""Which vehicles are in flight: what a process must know before it ends."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from std_msgs.msg import String

if TYPE_CHECKING:
    from crazyflie_utils.runtime.process import Process

TOPIC = "/flights"
"""Where whoever starts and ends flights tells of them, latched."""

_IN_FLIGHT, _ON_GROUND = "in flight", "on ground"


def announce(process: Process, node: str) -> tuple[Callable[[bool], None], Callable[[], None]]:
    """Return ``tell(in_flight)`` of the flights that a node starts and ends, and how to close it.

    Parameters
    ----------
    process : Process
    node : str
        Absolute name.
    """
    publisher = process.topics.publisher(TOPIC, String, latch=True)

    def tell(in_flight: bool) -> None:
        publisher.publish(String(f"{node} {_IN_FLIGHT if in_flight else _ON_GROUND}"))

    return tell, publisher.close


class Flights:
    """The flights that matter to some nodes: those in their namespaces, above and below.

    Parameters
    ----------
    process : Process
    nodes : iterable of str
        Absolute names.
    """

    def __init__(self, process: Process, nodes: Iterable[str]):
        self._namespaces = [_namespace(node) for node in nodes]
        self._in_flight: dict[str, bool] = {}
        process.topics.subscribe(TOPIC, String, self._note)

    @property
    def in_flight(self) -> list[str]:
        """Names of the nodes whose flights have not ended."""
        return sorted(name for name, flies in self._in_flight.items() if flies)

    def _note(self, message: String) -> None:
        name, _, state = message.data.partition(" ")
        here = _namespace(name)
        if any(here.startswith(each) or each.startswith(here) for each in self._namespaces):
            self._in_flight[name] = state == _IN_FLIGHT


def _namespace(name):
    return name.rpartition("/")[0] + "/"
