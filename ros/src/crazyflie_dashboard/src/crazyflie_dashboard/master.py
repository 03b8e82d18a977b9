"""Questions to the ROS master; they wait for answers, so they are for threads that may."""

import contextlib
import socket
from urllib.parse import urlsplit

import rosgraph

from crazyflie_dashboard.discovery import Graph

_LIMIT = 0.5  #: Of a connection to a service, s.


def read(caller: str) -> Graph:
    """Return what the master knows; OSError or rosgraph.MasterException if it does not answer."""
    master = rosgraph.Master(caller)
    types = dict(master.getTopicTypes())
    published, _, services = master.getSystemState()
    return Graph(
        topics={topic: types[topic] for topic, _ in published if topic in types},
        types=types,
        services={name: nodes[0] for name, nodes in services if nodes},
    )


def is_answering(caller: str, service: str) -> bool:
    """Tell whether the node of a service takes connections now."""
    with contextlib.suppress(OSError, rosgraph.MasterException, ValueError):
        uri = urlsplit(rosgraph.Master(caller).lookupService(service))
        socket.create_connection((uri.hostname or "", uri.port or 0), _LIMIT).close()
        return True
    return False
