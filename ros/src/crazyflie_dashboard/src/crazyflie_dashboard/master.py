"""Questions to the ROS master, each with a limit of time; they are for threads that may wait."""

import http.client
import xmlrpc.client
from collections.abc import Mapping

import rosgraph

from crazyflie_dashboard.discovery import Graph

_LIMIT = 2.0  #: Of an answer of the master, s.


class MasterError(OSError):
    """The master does not answer, or not what was asked for."""


def read(caller: str) -> Graph:
    """Return what the master knows, or raise `MasterError`."""
    types = dict(_ask("getTopicTypes", caller))
    published, _, services = _ask("getSystemState", caller)
    return Graph(
        topics={topic: types[topic] for topic, _ in published if topic in types},
        types=types,
        services={name: nodes[0] for name, nodes in services if nodes},
    )


def services(caller: str) -> Mapping[str, str]:
    """Return service -> node, or raise `MasterError`."""
    _, _, found = _ask("getSystemState", caller)
    return {name: nodes[0] for name, nodes in found if nodes}


def lookup(caller: str, service: str) -> str:
    """Return the address of a service, as in rosrpc://host:port, or raise `MasterError`."""
    return _ask("lookupService", caller, service)


class _Transport(xmlrpc.client.Transport):
    def make_connection(self, host):
        connection = super().make_connection(host)
        connection.timeout = _LIMIT
        return connection


def _ask(method, *arguments):
    uri = rosgraph.get_master_uri()
    try:
        with xmlrpc.client.ServerProxy(uri, transport=_Transport()) as proxy:
            code, text, value = getattr(proxy, method)(*arguments)
    except (OSError, http.client.HTTPException, xmlrpc.client.Error) as error:
        raise MasterError(f"the master at {uri} does not answer: {error}") from None
    if code != 1:
        raise MasterError(text)
    return value
