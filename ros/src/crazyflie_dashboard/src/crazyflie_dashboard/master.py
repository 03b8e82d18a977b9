"""Requests to the ROS master, each with a timeout; for threads that may wait."""

import contextlib
import http.client
import xmlrpc.client
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import rosgraph

from crazyflie_dashboard.discovery import Graph
from crazyflie_utils.ros1.master_watch import bounded_master

_LIMIT = 2.0  #: Longest time for an answer of the master (s).


class MasterError(OSError):
    """The master does not answer, or its answer is an error."""


class Master:
    """The ROS master, as it answers a node; every method may raise `MasterError`."""

    def __init__(self, caller: str):
        self.caller = caller

    def graph(self) -> Graph:
        """Return all topics and services."""
        with self._asked() as master:
            types = dict(master.getTopicTypes())
            published, _, services = master.getSystemState()
        return Graph(
            topics={topic: types[topic] for topic, _ in published if topic in types},
            types=types,
            services={name: nodes[0] for name, nodes in services if nodes},
        )

    def services(self) -> Mapping[str, str]:
        """Return service -> node."""
        with self._asked() as master:
            _, _, found = master.getSystemState()
        return {name: nodes[0] for name, nodes in found if nodes}

    def lookup(self, service: str) -> str:
        """Return the address of a service, as in rosrpc://host:port."""
        with self._asked() as master:
            return master.lookupService(service)

    def parameters(self, names: Iterable[str]) -> dict[str, Any]:
        """Return the values of those parameters that are set, in one request."""
        names = list(dict.fromkeys(names))
        with self._asked() as master:
            several: Any = xmlrpc.client.MultiCall(master.handle)
            for name in names:
                several.getParam(self.caller, name)
            answers = zip(names, several(), strict=True)
            return {name: value for name, (code, _, value) in answers if code == 1}

    @contextlib.contextmanager
    def _asked(self) -> Iterator[rosgraph.Master]:
        master = bounded_master(self.caller, _LIMIT)
        try:
            with master.handle:
                yield master
        except rosgraph.MasterException as error:
            raise MasterError(str(error)) from None
        except (OSError, http.client.HTTPException, xmlrpc.client.Error) as error:
            uri = master.master_uri
            raise MasterError(f"the master at {uri} does not answer: {error}") from None
