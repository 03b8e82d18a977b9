"""The vehicles in flight, for which a process waits before it ends."""

import time
from collections.abc import Iterable

from std_msgs.msg import String

from crazyflie_utils.topics import Topics

TOPIC = "/flights"  #: Topic of nodes that start and end flights, latched.

_IN_FLIGHT, _TO_END, _ON_GROUND = "in flight", "in flight, to end", "on ground"


class ShutdownInhibitor:
    """Publishes the flights that a node starts and ends, which inhibit the end of processes."""

    def __init__(self, topics: Topics, node: str):
        self.node = node  #: Absolute name of the node.
        self.in_flight = False  #: Last published value.
        self._publisher = topics.publisher(TOPIC, String, latch=True)

    def publish(self, in_flight: bool) -> None:
        """Publish whether there is a flight."""
        self.in_flight = in_flight
        self._send(_IN_FLIGHT if in_flight else _ON_GROUND)

    def publish_ending(self) -> None:
        """Publish that the flight, if any, is ending because its process is to end."""
        if self.in_flight:
            self._send(_TO_END)

    def close(self) -> None:
        """End the publication."""
        self.in_flight = False
        self._publisher.close()

    def _send(self, state):
        self._publisher.publish(String(f"{self.node} {state}"))


class Flights:
    """The flights that concern nodes, by absolute name: in their namespaces, above and below."""

    def __init__(self, topics: Topics, nodes: Iterable[str]):
        self._namespaces = [_namespace(node) for node in nodes]
        self._in_flight: dict[str, bool] = {}
        self._to_end_since: dict[str, float] = {}
        topics.subscribe(TOPIC, String, self._note)

    @property
    def in_flight(self) -> list[str]:
        """Names of the nodes whose flights have not ended."""
        return sorted(name for name, flies in self._in_flight.items() if flies)

    def unattended(self, within: float) -> list[str]:
        """Return those in flight that were not published as ending within ``within`` (s)."""
        since = time.monotonic() - within
        return [name for name in self.in_flight if self._to_end_since.get(name, since) <= since]

    def _note(self, message: String) -> None:
        name, _, state = message.data.partition(" ")
        here = _namespace(name)
        if any(here.startswith(each) or each.startswith(here) for each in self._namespaces):
            self._in_flight[name] = state in (_IN_FLIGHT, _TO_END)
            if state == _TO_END:
                self._to_end_since[name] = time.monotonic()


def _namespace(name):
    return name.rpartition("/")[0] + "/"
