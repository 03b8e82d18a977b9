"""Requests to the ROS master, each with a timeout; for threads that may wait."""

import http.client
import xmlrpc.client
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import rosgraph

from crazyflie_dashboard.discovery import Graph

_LIMIT = 2.0  #: Longest time for an answer of the master (s).


class MasterError(OSError):
    """The master does not answer, or its answer is an error."""


class Master:
    """The ROS master, as it answers a node; every method may raise `MasterError`."""

    def __init__(self, caller: str):
        self._caller = caller

    def graph(self) -> Graph:
        """Return all topics and services."""
        types = dict(self._ask("getTopicTypes"))
        published, _, services = self._ask("getSystemState")
        return Graph(
            topics={topic: types[topic] for topic, _ in published if topic in types},
            types=types,
            services={name: nodes[0] for name, nodes in services if nodes},
        )

    def services(self) -> Mapping[str, str]:
        """Return service -> node."""
        _, _, found = self._ask("getSystemState")
        return {name: nodes[0] for name, nodes in found if nodes}

    def lookup(self, service: str) -> str:
        """Return the address of a service, as in rosrpc://host:port."""
        return self._ask("lookupService", service)

    def parameters(self, names: Iterable[str]) -> dict[str, Any]:
        """Return the values of those parameters that are set, in one request."""
        names = list(dict.fromkeys(names))

        def ask(proxy):
            several: Any = xmlrpc.client.MultiCall(proxy)
            for name in names:
                several.getParam(self._caller, name)
            return [*several()]

        answers = zip(names, _answer(ask), strict=True)
        return {name: value for name, (code, _, value) in answers if code == 1}

    def _ask(self, method, *arguments):
        code, text, value = _answer(lambda proxy: getattr(proxy, method)(self._caller, *arguments))
        if code != 1:
            raise MasterError(text)
        return value


class _Transport(xmlrpc.client.Transport):
    def make_connection(self, host):
        connection = super().make_connection(host)
        connection.timeout = _LIMIT
        return connection


def _answer(ask: Callable[[Any], Any]) -> Any:
    uri = rosgraph.get_master_uri()
    try:
        with xmlrpc.client.ServerProxy(uri, transport=_Transport()) as proxy:
            return ask(proxy)
    except (OSError, http.client.HTTPException, xmlrpc.client.Error) as error:
        raise MasterError(f"the master at {uri} does not answer: {error}") from None
